"""One cause is one group, whatever numbers, paths and commands its reasons have."""

from __future__ import annotations

import pytest

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
