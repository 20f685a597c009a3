"""How often the runs of a configuration do not pass, and how sure that is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from statistics import median
from typing import Any

from robovast.base.sequential import Decision, State
from robovast.base.statistics import Interval, anytime, least, wilson
from robovast.campaign.decisions import CampaignTest
from robovast.campaign.planned_runs import is_fixed
from robovast.campaign.verdict import Verdict
from robovast.evaluation.summaries import CampaignSummary, RunSummary, VariantRuns, decision_of

LIMIT = 0.1
"""Share of bad runs up to which a configuration counts as sound, unless users say otherwise."""
MOST_RUNS = 100_000
"""Most further runs that are suggested."""

IntervalOf = Callable[[float, float], Interval]
"""Interval of a rate, by the number of bad runs and of all runs."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Runs with a verdict, and how many of them did not pass."""

    runs: int
    bad: int
    duration: float | None
    """Median [s]"""

    @property
    def rate(self) -> float:
        """Share of the runs that did not pass; 0 without runs."""
        return self.bad / self.runs if self.runs else 0.0


@dataclass(frozen=True, slots=True)
class Rate:
    """How often runs do not pass."""

    runs: int
    """Runs with a verdict; interrupted ones have none."""
    failed: int
    errored: int
    rate: float | None
    """Share of the runs that failed or errored; None without runs."""
    interval: Interval
    """95 % interval of the rate."""


@dataclass(frozen=True, slots=True)
class VariantRate:
    """How a configuration went."""

    name: str
    parameters: Mapping[str, Any]
    state: State
    """The decision's; without one `broken` when the whole interval is above the limit, and `sound`
    when it is below."""
    rate: Rate
    more_runs: int | None
    """How many further runs of the campaign decide it if they go as those before; None if it is
    decided, or if `MOST_RUNS` do not."""
    reason: str
    """The most frequent reason of its bad runs."""
    decision: Decision | None
    """What the campaign's test says, if it has one."""


@dataclass(frozen=True)
class CampaignRates:
    """How a campaign went."""

    summary: CampaignSummary
    limit: float
    method: str
    """`wilson` or `anytime`; see `why_wider`."""
    overall: Rate
    configurations: list[VariantRate]
    """The worst first."""

    @property
    def states(self) -> Mapping[State, int]:
        """Configurations by state, the worst first."""
        found = Counter(variant.state for variant in self.configurations)
        return {state: found[state] for state in State}


def campaign_rates(
    summary: CampaignSummary, variants: Iterable[VariantRuns], limit: float = LIMIT
) -> CampaignRates:
    """Judge the configurations of a campaign.

    Args:
        summary: the campaign.
        variants: its configurations with their runs.
        limit: threshold between passing and failing, if no test decides.
    """
    interval_of = interval_for(summary)
    variants = list(variants)
    rates = [_judge(variant, limit, interval_of, summary.test) for variant in variants]
    return CampaignRates(
        summary=summary,
        limit=limit,
        method=interval_of.__name__,
        overall=rate_of(variants, interval_of),
        configurations=sorted(rates, key=_worst_first),
    )


def soonest_decided(rates: CampaignRates) -> VariantRate | None:
    """The undecided configuration that the fewest further runs decide, if any do."""
    undecided = [one for one in rates.configurations if one.more_runs and one.decision is None]
    return min(undecided, key=lambda one: one.more_runs or 0, default=None)


def interval_for(summary: CampaignSummary) -> IntervalOf:
    """The interval that holds for a campaign: while runs are added, one looks more than once."""
    return anytime if why_wider(summary) else wilson


def why_wider(summary: CampaignSummary) -> str:
    """Why a campaign's intervals are wider than those of a fixed number of runs, in a sentence.

    Empty for a fixed number. Who adds runs of a configuration has looked at all of them.
    """
    if summary.test is not None:
        why = "The verdicts decide the number of runs"
    elif summary.is_search:
        why = "The search chose its runs by the verdicts"
    elif not is_fixed(summary.execution):
        why = "Runs were added after the verdicts were visible"
    elif summary.state != "finished":
        why = "Runs are missing"
    else:
        return ""
    return f"{why}, so all intervals are wider and valid at any time."


def sample(*variants: VariantRuns) -> Sample:
    """All runs of the variants."""
    return sample_of(run for variant in variants for run in variant.runs)


def sample_of(runs: Iterable[RunSummary]) -> Sample:
    """Runs, except interrupted ones."""
    runs = [run for run in runs if run.verdict is not Verdict.INTERRUPTED]
    durations = [run.duration for run in runs if run.duration is not None]
    bad = sum(run.verdict is not Verdict.PASSED for run in runs)
    return Sample(len(runs), bad, median(durations) if durations else None)


def rate_of(variants: Iterable[VariantRuns], interval_of: IntervalOf) -> Rate:
    """The rate of all runs of the variants."""
    counts = Counter(run.verdict for variant in variants for run in variant.runs)
    failed, errored = counts[Verdict.FAILED], counts[Verdict.ERRORED]
    runs = counts[Verdict.PASSED] + failed + errored
    rate = (failed + errored) / runs if runs else None
    return Rate(runs, failed, errored, rate, interval_of(failed + errored, runs))


def _judge(
    variant: VariantRuns, limit: float, interval_of: IntervalOf, test: CampaignTest | None
) -> VariantRate:
    rate = rate_of([variant], interval_of)
    decision = None if test is None else decision_of(test, variant)
    more = _more_runs(rate.failed + rate.errored, rate.runs, limit, interval_of)
    bad = [run.reason for run in variant.runs if run.verdict in (Verdict.FAILED, Verdict.ERRORED)]
    return VariantRate(
        name=variant.name,
        parameters=variant.parameters,
        state=_state(rate.interval, limit) if decision is None else decision.state,
        rate=rate,
        more_runs=more if decision is None else decision.further or None,
        reason=Counter(bad).most_common(1)[0][0] if bad else "",
        decision=decision,
    )


def _state(interval: Interval, limit: float) -> State:
    low, high = interval
    if low > limit:
        return State.BROKEN
    return State.SOUND if high < limit else State.UNDECIDED


@cache
def _more_runs(bad: int, runs: int, limit: float, interval_of: IntervalOf) -> int | None:
    """How many further runs decide it, if the rate stays as it is; None if it is decided.

    They are added after a look, whatever interval holds before.
    """

    def decide(more: int) -> bool:
        share = 1 + more / runs if runs else 0.0
        return _state(anytime(bad * share, runs + more), limit) is not State.UNDECIDED

    decided = _state(interval_of(bad, runs), limit) is not State.UNDECIDED
    return None if decided else least(decide, MOST_RUNS)


def _worst_first(variant: VariantRate) -> tuple[int, float, int]:
    return list(State).index(variant.state), -(variant.rate.rate or 0.0), -variant.rate.runs
