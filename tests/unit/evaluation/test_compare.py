"""A difference is only called one when chance hardly explains it."""

from __future__ import annotations

import pytest

from robovast.campaign.verdict import Verdict
from robovast.evaluation.compare import compare
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
        "The share of runs that did not pass rose, from 10 % (10 of 100) to 30 % (30 of 100); "
        "chance alone hardly explains that (Fisher's exact test, p = 0.00065; 95 % interval "
        "+9.0 to +30.6 points)."
    )
    assert (
        "chance can explain that" in compare([variant("a", 9, 1)], [variant("a", 7, 3)]).statement
    )


def test_campaigns_with_nothing_in_common() -> None:
    assert "share no variant" in compare([variant("a", 1, 0)], [variant("b", 1, 0)]).statement


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
