"""A difference is only called one when chance hardly explains it."""

from __future__ import annotations

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
        "The share of runs that did not pass rose, from 10.0% (10 of 100) to 30.0% (30 of 100); "
        "chance alone hardly explains that (Fisher's exact test, p = 0.00065; 95 % interval "
        "+9.0 to +30.6 points)."
    )
    assert (
        "chance can explain that" in compare([variant("a", 9, 1)], [variant("a", 7, 3)]).statement
    )


def test_campaigns_with_nothing_in_common() -> None:
    assert "share no variant" in compare([variant("a", 1, 0)], [variant("b", 1, 0)]).statement
