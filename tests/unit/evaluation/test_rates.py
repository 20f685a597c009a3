"""A configuration is sound or broken only when its runs show it; the worst come first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robovast.base.statistics import anytime, wilson
from robovast.campaign.verdict import Verdict
from robovast.evaluation.rates import MOST_RUNS, State, campaign_rates, soonest_decided, why_wider
from robovast.evaluation.summaries import CampaignSummary, RunSummary, VariantRuns


def variant(name: str, passed: int, bad: int, errored: int = 0) -> VariantRuns:
    verdicts = [Verdict.PASSED] * passed + [Verdict.FAILED] * bad + [Verdict.ERRORED] * errored
    verdicts.append(Verdict.INTERRUPTED)
    runs = [
        RunSummary(number, verdict, "" if verdict == "passed" else f"it {verdict}", None, 2.0)
        for number, verdict in enumerate(verdicts)
    ]
    return VariantRuns(name, "hall", {}, tuple(runs))


def summary(state: str = "finished") -> CampaignSummary:
    return CampaignSummary("hall", state, 99, dict.fromkeys(Verdict, 0), 4, None, None, {}, 1)


def test_the_worst_comes_first_and_nothing_is_decided_by_too_few_runs() -> None:
    found = campaign_rates(
        summary(),
        [
            variant("few", 5, 0),
            variant("fine", 60, 1),
            variant("bad", 4, 5, 1),
            variant("one", 4, 1),
        ],
    )
    assert [(v.name, v.state) for v in found.configurations] == [
        ("bad", State.BROKEN),
        ("one", State.UNDECIDED),
        ("few", State.UNDECIDED),
        ("fine", State.SOUND),
    ]
    assert dict(found.states) == {State.BROKEN: 1, State.UNDECIDED: 2, State.SOUND: 1}
    bad = found.configurations[0]
    assert (bad.rate.runs, bad.rate.failed, bad.rate.errored) == (10, 5, 1)
    assert bad.reason == "it failed"
    assert bad.rate.interval == wilson(6, 10)
    assert (found.overall.runs, found.overall.rate) == (81, pytest.approx(8 / 81))


def test_as_many_more_runs_decide_it_as_are_said() -> None:
    clean = campaign_rates(summary(), [variant("few", 5, 0)]).configurations[0]
    assert clean.more_runs is not None
    in_all = 5 + clean.more_runs
    assert anytime(0, in_all - 1)[1] >= 0.1 > anytime(0, in_all)[1]


def test_who_adds_runs_to_a_finished_campaign_has_looked_before() -> None:
    for how in (
        {"runs": 5, "more_runs": {"few": 9}, "runs_added": True},
        {"runs": 9, "runs_added": True},
    ):
        added = replace(summary(), execution={**how, "runs_added": True})
        assert campaign_rates(added, [variant("few", 9, 0)]).method == "anytime"
        assert why_wider(added).startswith(
            "Runs were added after the verdicts were visible, so all"
        )
    assert why_wider(summary()) == ""


def test_the_configuration_that_the_fewest_runs_decide_is_named() -> None:
    few, most = variant("few", 5, 0), variant("many", 40, 5)
    found = campaign_rates(summary(), [most, few, variant("bad", 0, 30)])
    nearest = soonest_decided(found)
    assert nearest is not None
    assert nearest.name == "few"
    assert soonest_decided(campaign_rates(summary(), [variant("bad", 0, 30)])) is None


def test_a_rate_at_the_limit_is_never_decided() -> None:
    at_the_limit = campaign_rates(summary(), [variant("half", 5, 5)], 0.5).configurations[0]
    assert (at_the_limit.state, at_the_limit.more_runs) == (State.UNDECIDED, None)
    assert MOST_RUNS > 10_000


def test_a_configuration_without_runs_is_undecided_and_has_no_rate() -> None:
    nothing = campaign_rates(summary(), [variant("none", 0, 0)])
    only = nothing.configurations[0]
    assert (only.state, only.rate.rate, only.rate.interval) == (State.UNDECIDED, None, (0.0, 1.0))
    assert anytime(0, (only.more_runs or 0) - 1)[1] >= 0.1 > anytime(0, only.more_runs or 0)[1]
    assert nothing.overall.rate is None


def test_while_runs_are_missing_the_interval_is_one_that_holds_whenever_one_looks() -> None:
    for state in ("running", "incomplete"):
        found = campaign_rates(summary(state), [variant("bad", 4, 6)])
        assert found.method == "anytime"
        assert why_wider(summary(state)).startswith("Runs are missing, so all intervals")
        assert found.configurations[0].rate.interval == anytime(6, 10)
