"""A difference is only called one when chance hardly explains it."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.statistics import LEVEL, fisher_exact, holm, mcnemar_exact
from robovast.campaign.verdict import Verdict
from robovast.evaluation.compare import Difference, compare
from robovast.evaluation.rates import Sample
from robovast.evaluation.summaries import RunSummary, VariantRuns


def variant(name: str, passed: int, bad: int, **parameters) -> VariantRuns:
    verdicts = [Verdict.PASSED] * passed + [Verdict.FAILED] * bad + [Verdict.INTERRUPTED]
    runs = [RunSummary(i, verdict, "", None, 2.0) for i, verdict in enumerate(verdicts)]
    return VariantRuns(name, "hall", parameters, tuple(runs))


def test_variants_of_equal_parameters_are_compared_whatever_their_names() -> None:
    found = compare(
        [variant("a-1", 20, 0, x=1), variant("a-2", 20, 0, x=2), variant("a-3", 1, 0, x=3)],
        [variant("b-1", 19, 1, x=2), variant("b-2", 2, 18, x=1), variant("b-4", 1, 0, x=4)],
    )
    assert [(v.name_a, v.name_b, v.change) for v in found.variants] == [
        ("a-1", "b-2", "worse"),
        ("a-2", "b-1", "unclear"),
    ]
    assert (found.only_a, found.only_b) == (["a-3"], ["b-4"])
    assert found.overall.b == Sample(40, 19, 2.0)


def test_better_and_same() -> None:
    found = compare(
        [variant("a", 0, 20, x=1), variant("b", 5, 5, x=2)],
        [variant("a", 20, 0, x=1), variant("b", 5, 5, x=2)],
    )
    assert [v.change for v in found.variants] == ["better", "same"]


def test_the_statement_has_numbers_and_a_judgement() -> None:
    worse = compare([variant("a", 90, 10)], [variant("a", 70, 30)])
    assert worse.statement == (
        "The rate of unsuccessful runs rose from 10 % (10 of 100) to 30 % (30 of 100), and "
        "chance alone hardly explains it (Fisher's exact test, p = 0.00065; 95 % interval "
        "+9.0 to +30.6 percentage points)."
    )
    assert "chance can explain it" in compare([variant("a", 9, 1)], [variant("a", 7, 3)]).statement


def test_campaigns_with_nothing_in_common() -> None:
    assert (
        "no configuration has runs in both"
        in compare([variant("a", 1, 0)], [variant("b", 1, 0)]).statement
    )


def seeded(name: str, verdicts: str, seeds: range | None = None) -> VariantRuns:
    """A variant with one run for each letter: `p` passed, `f` failed, `i` was interrupted."""
    known = {"p": Verdict.PASSED, "f": Verdict.FAILED, "i": Verdict.INTERRUPTED}
    seeds = range(len(verdicts)) if seeds is None else seeds
    runs = [
        RunSummary(number, known[letter], "", None, 2.0, seed)
        for number, (letter, seed) in enumerate(zip(verdicts, seeds, strict=True))
    ]
    return VariantRuns(name, "hall", {}, tuple(runs))


def test_runs_of_equal_seeds_are_compared_in_pairs() -> None:
    found = compare([seeded("a", "pppppppffi")], [seeded("a", "ffffffpffp")])
    only = found.variants[0]
    assert only.difference.pairs == (6, 0)
    assert only.difference.p == found.overall.p == pytest.approx(2 / 2**6)
    assert (only.change, found.change, found.result) == ("worse", "worse", "worse")
    assert "McNemar's exact test, equal seeds" in found.statement
    apart = compare([seeded("a", "pppppppffi")], [seeded("a", "ffffffpffp", range(50, 60))])
    assert apart.variants[0].difference.pairs is None


def test_runs_are_no_pairs_when_either_campaign_has_runs_without_partner() -> None:
    found = compare([seeded("a", "ppp")], [seeded("a", "fpp", range(1, 4))])
    assert found.overall.pairs is None
    assert found.overall.b.runs == 3
    more = compare([seeded("a", "ppp")], [seeded("a", "fpppp")])
    assert (more.overall.pairs, more.overall.b.runs) == ((1, 0), 3)


def test_a_campaign_with_more_runs_of_what_is_broken_is_not_worse_for_that() -> None:
    found = compare(
        [variant("good", 90, 0), variant("broken", 0, 10)],
        [variant("good", 10, 0), variant("broken", 0, 90)],
    )
    assert (found.overall.a.runs, found.overall.a.bad) == (20, 10)
    assert (found.overall.b.runs, found.overall.b.bad) == (20, 10)


def test_what_is_unclear_says_how_many_more_runs_decide_it() -> None:
    found = compare([variant("a", 19, 1)], [variant("a", 16, 4)])
    only = found.variants[0]
    assert (only.change, found.change) == ("unclear", "unclear")
    more = only.more_runs
    assert more is not None
    assert more == found.more_runs
    for runs, change in ((20 + more + 5, "worse"), (20 + more - 8, "unclear")):
        bad_a, bad_b = round(0.05 * runs), round(0.2 * runs)
        later = compare([variant("a", runs - bad_a, bad_a)], [variant("a", runs - bad_b, bad_b)])
        assert later.change == change


def test_a_rate_that_surely_rose_by_less_than_the_margin_is_the_same() -> None:
    before, after = [variant("a", 1000, 100)], [variant("a", 985, 115)]
    assert compare(before, after).change == "same"
    assert compare(before, after, margin=0.01).change == "unclear"
    assert compare([variant("a", 5, 0)], [variant("a", 5, 0)]).change == "unclear"


def test_one_configuration_that_got_worse_makes_the_whole_worse() -> None:
    others = [variant(str(x), 40, 0, x=x) for x in range(20)]
    found = compare([variant("a", 40, 0), *others], [variant("a", 25, 15), *others])
    assert (found.change, found.result) == ("same", "worse")


def test_without_runs_in_one_campaign_nothing_is_known() -> None:
    found = compare([variant("a", 0, 0)], [variant("a", 5, 0)])
    assert (found.variants[0].change, found.variants[0].more_runs) == ("unclear", None)


def test_it_says_what_so_few_runs_could_have_shown_at_all() -> None:
    few = compare(
        [variant("a", 2, 0, x=1), variant("b", 2, 0, x=2)],
        [variant("a", 0, 2, x=1), variant("b", 2, 0, x=2)],
    )
    assert (few.least_p, few.visible, few.needed_runs) == (pytest.approx(1 / 3), 0, 5)
    enough = compare([variant("a", 5, 0)], [variant("a", 0, 5)])
    assert (enough.visible, enough.needed_runs) == (1, 4)
    assert enough.detectable == pytest.approx(0.8, abs=0.21)
    pairs = compare([seeded("a", "pppp")], [seeded("a", "ffff")])
    assert (pairs.least_p, pairs.visible) == (0.125, 0)


def test_where_nothing_ran_nothing_could_be_shown() -> None:
    found = compare([variant("a", 1, 0)], [variant("a", 0, 0)])
    assert (found.least_p, found.visible, found.detectable) == (1.0, 0, None)


def changed(configurations: int, runs: int, paired: bool, broken: Sequence[int]) -> list[str]:
    """The answers for configurations of which some change from never failing to always."""

    def campaign(later: bool) -> list[VariantRuns]:
        seeds = range(runs) if paired or not later else range(1000, 1000 + runs)
        return [
            replace(
                seeded(str(x), ("f" if later and x in broken else "p") * runs, seeds),
                parameters={"x": x},
            )
            for x in range(configurations)
        ]

    found = compare(campaign(False), campaign(True))
    return [next(v.change for v in found.variants if v.name_a == str(x)) for x in broken]


def needed(configurations: int, paired: bool) -> int:
    few = [seeded(str(x), "p") for x in range(configurations)]
    before = [replace(one, parameters={"x": x}) for x, one in enumerate(few)]
    seeds = range(1) if paired else range(7, 8)
    after = [replace(seeded("y", "f", seeds), parameters={"x": x}) for x in range(configurations)]
    runs = compare(before, after).needed_runs
    assert runs is not None
    return runs


def test_eighteen_configurations_with_equal_seeds_need_ten_runs() -> None:
    assert (needed(18, paired=True), needed(18, paired=False)) == (10, 6)


@given(st.integers(1, 60), st.booleans(), st.data())
def test_the_needed_runs_are_the_least_that_show_one_change(
    configurations: int, paired: bool, data: st.DataObject
) -> None:
    runs = needed(configurations, paired)
    broken = [data.draw(st.integers(0, configurations - 1))]
    assert changed(configurations, runs, paired, broken) == ["worse"]
    if runs > 1:
        assert changed(configurations, runs - 1, paired, broken) == ["unclear"]


@given(st.lists(st.tuples(st.integers(1, 14), st.booleans()), min_size=1, max_size=25))
def test_as_many_changes_are_visible_as_are_found_if_all_change(
    sizes: list[tuple[int, bool]],
) -> None:
    before, after = [], []
    for x, (runs, paired) in enumerate(sizes):
        seeds = range(runs) if paired else range(100, 100 + runs)
        before.append(replace(seeded(f"a{x}", "p" * runs), parameters={"x": x}))
        after.append(replace(seeded(f"b{x}", "f" * runs, seeds), parameters={"x": x}))
    found = compare(before, after)
    assert found.visible == sum(one.change == "worse" for one in found.variants)


def is_shown(found: Difference, size: int, more: int, others: list[float]) -> bool:
    """Whether so many more runs like those before are significant beside other p-values."""
    share = (size + more) / size
    if found.pairs is not None:
        p = mcnemar_exact(*(round(count * share) for count in found.pairs))
    else:
        a, b = round(found.a.bad * share), round(found.b.bad * share)
        p = fisher_exact(a, size + more - a, b, size + more - b)
    return holm([p, *others])[0] < LEVEL


@given(
    st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), min_size=1, max_size=12),
    st.booleans(),
)
def test_the_runs_that_decide_decide_and_one_run_less_does_not(
    counts: list[tuple[int, int]], paired: bool
) -> None:
    """Holm's correction included: the other configurations stay as they are."""
    size = 8
    before, after = [], []
    for x, (worse, better) in enumerate(counts):
        better = min(better, size - worse)
        both = "p" * (size - worse - better)
        seeds = range(size) if paired else range(100, 100 + size)
        one = seeded(f"a{x}", "p" * worse + "f" * better + both)
        other = seeded(f"b{x}", "f" * worse + "p" * better + both, seeds)
        before.append(replace(one, parameters={"x": x}))
        after.append(replace(other, parameters={"x": x}))
    found = compare(before, after)
    ps = [one.difference.p for one in found.variants]
    for place, one in enumerate(found.variants):
        if one.change != "unclear" or one.more_runs is None:
            continue
        others = [*ps[:place], *ps[place + 1 :]]
        assert is_shown(one.difference, size, one.more_runs, others)
        assert one.more_runs == 1 or not is_shown(one.difference, size, one.more_runs - 1, others)


@pytest.mark.parametrize("paired", [True, False])
def test_without_a_change_a_simulated_campaign_is_rarely_called_worse(paired: bool) -> None:
    chance = random.Random(5)  # noqa: S311
    wrong = 0
    for _ in range(300):
        sides = []
        for seeds in (range(12), range(12) if paired else range(50, 62)):
            sides.append(
                [
                    replace(
                        seeded(str(x), "".join(chance.choices("pf", k=12)), seeds),
                        parameters={"x": x},
                    )
                    for x in range(5)
                ]
            )
        wrong += any(one.change in {"worse", "better"} for one in compare(*sides).variants)
    assert wrong <= 0.05 * 300


def test_a_rise_that_would_show_is_that_of_the_applied_test() -> None:
    before = seeded("a", "p" * 20)
    pairs = compare([before], [seeded("a", "p" * 20)]).detectable
    assert pairs == pytest.approx(6 / 20)  # McNemar: six pairs; five give p = 0.0625
    apart = compare([before], [seeded("a", "p" * 20, range(50, 70))]).detectable
    assert apart == pytest.approx(5 / 20)  # Fisher: 5 of 20 give p = 0.047
    noisy = compare([seeded("a", "f" + "p" * 19)], [seeded("a", "pf" + "p" * 18)]).detectable
    assert noisy == pytest.approx(7 / 20)  # one pair got better: eight must get worse


def started(one: VariantRuns) -> VariantRuns:
    runs = tuple(replace(run, started_at=100.0 + run.number, seed=None) for run in one.runs)
    return replace(one, runs=runs)


@given(st.lists(st.text("pfi", min_size=1, max_size=6), min_size=1, max_size=5))
def test_a_campaign_does_not_differ_from_itself(verdicts: list[str]) -> None:
    def campaign() -> list[VariantRuns]:
        return [
            replace(started(seeded(str(x), one)), parameters={"x": x})
            for x, one in enumerate(["p", *verdicts])
        ]

    found = compare(campaign(), campaign(), margin=0)
    assert (found.change, found.result) == ("same", "same")
    assert found.statement.startswith("No difference: both have the same ")
    assert {one.change for one in found.variants if one.difference.a.runs} == {"same"}
    unknown = [seeded("a", "pf")]
    assert compare(unknown, unknown).result == "same"


def test_equal_results_of_other_runs_prove_little() -> None:
    found = compare([seeded("a", "pf")], [seeded("a", "pf")])
    assert found.statement.startswith(
        "No difference: 50 % (1 of 2) and 50 % (1 of 2) of the runs were unsuccessful "
        "(McNemar's exact test, equal seeds, p = 1;"
    )
    assert found.detectable is None
    assert (found.result, found.variants[0].change) == ("unclear", "same")
