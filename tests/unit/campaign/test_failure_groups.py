"""One cause is one group, whatever numbers, paths and commands its reasons have."""

from __future__ import annotations

import random
from itertools import chain

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robovast.campaign.failure_groups import NO_REASON, cause_key, failure_groups
from robovast.campaign.verdict import Verdict

P, F, E = Verdict.PASSED, Verdict.FAILED, Verdict.ERRORED
OLD = (
    "execution failed.: Execution of '['python3', '{}', '--x' … in', '0.1', '/out/{}']' "
    "failed with 1"
)
"""Of runs whose reasons were made by earlier versions."""


@pytest.mark.parametrize(
    "reasons",
    [
        ["collision after 9.1 s at 3.66, 1.13", "collision after 3 s at -1.08, -2.80"],
        ["no way from drive-1-1-2-1", "no way from drive-2-1"],
        ["obstacle_0 is stuck", "obstacle_12 is stuck"],
        ["lost 0x7f3a", "lost 0xbeef"],
        ["no /a/b/map1.yaml", "no /c/map2.yaml"],
        [OLD.format("/a/.running/job-0/co", "hall-1/0"), OLD.format("/b/job-12/co", "hall-2/7")],
    ],
)
def test_numbers_and_paths_make_no_other_cause(reasons: list[str]) -> None:
    assert len({cause_key(reason) for reason in reasons}) == 1


@pytest.mark.parametrize(
    "reasons",
    [
        ["collision at 1, 2", "no way at 1, 2"],
        ["exit code 1", "exit code 2"],
        ["python3 a.py failed with 1", "python3 a.py failed with 2"],
        ["KeyError: 'speed'", "KeyError: 'goal'"],
        ["it was ended by SIGSEGV", "it was ended by SIGKILL"],
    ],
)
def test_other_words_and_codes_are_other_causes(reasons: list[str]) -> None:
    assert len({cause_key(reason) for reason in reasons}) == len(reasons)


def test_the_largest_group_comes_first_and_shows_what_its_reasons_share() -> None:
    runs = [
        ("a", F, "share 0.5 below 0.9"),
        ("b", P, ""),
        ("c", E, "stopped after 60 s"),
        ("d", F, "share 0.7 below 0.9"),
        ("e", E, ""),
    ]
    found = [(group.cause, group.verdicts, group.runs) for group in failure_groups(runs)]
    assert found == [
        ("share … below 0.9", (F,), ("a", "d")),
        ("stopped after 60 s", (E,), ("c",)),
        (NO_REASON, (E,), ("e",)),
    ]


def test_a_cause_may_have_several_verdicts() -> None:
    (group,) = failure_groups([("a", E, "no map"), ("b", F, "no map")])
    assert group.verdicts == (F, E)


def reasons_of(*groups: list[float], text: str = "collision after {:.1f} s at 1.50, -1.50") -> list:
    return [(n, F, text.format(value)) for n, value in enumerate(chain(*groups))]


def causes_of(*groups: list[float], **more: str) -> list[tuple[str, str, int]]:
    found = failure_groups(reasons_of(*groups, **more))
    return sorted((group.cause, group.numbers, len(group.runs)) for group in found)


def spread(low: float, high: float, runs: int) -> list[float]:
    return [low + (high - low) * n / (runs - 1) for n in range(runs)]


def test_a_robot_in_a_wall_and_one_that_drives_into_it_are_two_causes() -> None:
    assert causes_of([0.1] * 11, spread(1.3, 7.8, 45)) == [
        ("collision after 0.1 s at 1.50, -1.50", "", 11),
        ("collision after 1.3 – 7.8 s at 1.50, -1.50", "", 45),
    ]
    assert [runs for *_, runs in causes_of([0.0] * 3, spread(1.3, 7.8, 45))] == [3, 45]


def test_numbers_without_separate_groups_have_their_range() -> None:
    assert causes_of(spread(0.1, 7.8, 56)) == [
        ("collision after … s at 1.50, -1.50", "0.1 – 7.8 s", 56)
    ]
    places = [(n, F, f"stuck at {n / 10:.1f}, {-n / 5:.1f} m in obstacle_{n}") for n in range(9)]
    (group,) = failure_groups(places)
    assert group.text == "stuck at … m in obstacle_… (0.0 – 0.8, -1.6 – 0.0 m)"


def test_two_places_are_two_causes_and_name_the_coordinate_that_separates_them() -> None:
    places = [*((1.5 + n / 100, n) for n in range(5)), *((-1.1 - n / 100, n) for n in range(5))]
    runs = [(n, F, f"collision at {x:.2f}, {y:.2f}") for n, (x, y) in enumerate(places)]
    found = {(group.cause, group.numbers) for group in failure_groups(runs)}
    assert found == {
        ("collision at 1.50 – 1.54, …", "0.00 – 4.00"),
        ("collision at -1.14 – -1.10, …", "0.00 – 4.00"),
    }


def test_few_runs_apart_make_no_cause() -> None:
    assert len(causes_of([0.1] * 2, spread(1.3, 7.8, 20))) == 1
    assert len(causes_of([0.1] * 3, spread(1.3, 7.8, 97))) == 1
    assert len(causes_of([0.1] * 5, spread(1.3, 7.8, 95))) == 2


@given(st.integers(0, 2**32), st.integers(3, 40), st.integers(3, 40), st.floats(3, 50))
def test_groups_that_are_clearly_separate_are_found(
    seed: int, below: int, above: int, factor: float
) -> None:
    """Neither of them has gaps that are nearly as wide as the one between them."""
    chance = random.Random(seed)  # noqa: S311
    assume(min(below, above) >= 0.05 * (below + above))
    low = [chance.uniform(0.8, 1.0) for _ in range(below)]
    high = [chance.uniform(factor, 1.2 * factor) for _ in range(above)]
    both = [*low, *high]
    chance.shuffle(both)
    found = causes_of(both, text="no goal after {:.3f} s")
    assert sorted(runs for *_, runs in found) == sorted((below, above))


@pytest.mark.parametrize("runs", [6, 10, 20, 50])
@pytest.mark.parametrize(
    "draw",
    [
        lambda chance: chance.uniform(0.1, 8),
        lambda chance: chance.lognormvariate(1, 0.6),
        lambda chance: chance.expovariate(0.5),
        lambda chance: chance.gauss(0, 1),
        lambda chance: chance.uniform(-2, 2),
    ],
)
def test_one_distribution_is_hardly_ever_divided(draw, runs: int) -> None:
    chance = random.Random(11)  # noqa: S311
    divided = sum(
        len(causes_of([draw(chance) for _ in range(runs)], text="at {:.2f} m")) > 1
        for _ in range(200)
    )
    assert divided <= 0.06 * 200


@given(st.lists(st.tuples(st.floats(-50, 50), st.integers(0, 10**6)), min_size=1, max_size=40))
def test_every_run_is_in_one_group_and_no_two_groups_share_a_name(
    numbers: list[tuple[float, int]],
) -> None:
    runs = [(n, F, f"lost at {x:.2f} m, pid {y}") for n, (x, y) in enumerate(numbers)]
    found = failure_groups(runs)
    assert sorted(run for group in found for run in group.runs) == list(range(len(runs)))
    assert len({group.cause for group in found}) == len(found)
    assert {cause_key(reason) for *_, reason in runs} == {cause_key("lost at 1 m, pid 2")}
