"""What a report of a campaign holds, for people who have neither the results nor the page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from robovast.campaign.failure_groups import FailureGroup, cause_key, failure_groups
from robovast.evaluation.campaign_index import CampaignIndex
from robovast.evaluation.campaign_inputs import About, Change, about, changes
from robovast.evaluation.compare import Comparison, compare
from robovast.evaluation.factors import Explained, explain
from robovast.evaluation.matrix import Matrix, matrix
from robovast.evaluation.rates import CampaignRates, VariantRate, campaign_rates
from robovast.evaluation.run_endings import LogEnd, draw_ending, log_end, worst_run
from robovast.evaluation.summaries import RunSummary, VariantRuns

MOST_WORST = 6
"""Configurations with their map and last seconds."""
PICTURE_BYTES = 400_000
"""Size of all maps together: mail servers refuse large files."""


@dataclass(frozen=True)
class Worst:
    """A configuration that fails, and one of its runs that did."""

    rate: VariantRate
    variant: VariantRuns
    run: RunSummary
    ending: LogEnd | None
    """None without a log."""
    picture: str
    """Its map as SVG; empty if there is none."""
    missing: str
    """Why there is no picture, or no way in it, if there is a map."""


@dataclass(frozen=True)
class Baseline:
    """Another campaign, and what differs from it."""

    name: str
    comparison: Comparison
    changes: Sequence[Change]


@dataclass(frozen=True)
class CampaignReport:
    """All that a report says."""

    about: About
    rates: CampaignRates
    causes: Sequence[FailureGroup[str]]
    explained: Explained
    matrix: Matrix
    """By the two factors that separate failures best."""
    units: dict[str, str]
    worst: Sequence[Worst]
    baseline: Baseline | None


def make_report(index: CampaignIndex, base: CampaignIndex | None) -> CampaignReport:
    """Gather what a report says of a campaign.

    Args:
        index: the campaign.
        base: what it is compared with; None for a report without a comparison.
    """
    variants = index.variants
    rates = campaign_rates(index.summary(), variants)
    explained = explain(variants)
    return CampaignReport(
        about=about(index.results, index.name),
        rates=rates,
        causes=failure_groups(
            (f"{variant.name}/{run.number}", run.verdict, run.reason)
            for variant in variants
            for run in variant.runs
        ),
        explained=explained,
        matrix=matrix(variants, explained.axes),
        units={name: unit for variant in variants for name, unit in variant.units.items()},
        worst=_within(PICTURE_BYTES, _worst(index, rates)),
        baseline=None if base is None else _baseline(base, index),
    )


def _baseline(base: CampaignIndex, index: CampaignIndex) -> Baseline:
    return Baseline(
        base.name,
        compare(base.variants, index.variants),
        changes((base.results, base.name), (index.results, index.name)),
    )


def _worst(index: CampaignIndex, rates: CampaignRates) -> Iterator[Worst]:
    variants = {variant.name: variant for variant in index.variants}
    for rate in worst_of_causes(rates.configurations, MOST_WORST):
        variant = variants[rate.name]
        run = worst_run(variant)
        if run is not None:
            picture, missing = draw_ending(index.results, index.name, variant, run.number)
            ending = log_end(index.results, index.name, f"{variant.name}/{run.number}")
            yield Worst(rate, variant, run, ending, picture, missing)


def worst_of_causes(configurations: Sequence[VariantRate], most: int) -> list[VariantRate]:
    """Configurations that fail: the worst of each cause, then the second of each, and so on.

    Args:
        configurations: of a campaign, the worst first.
        most: how many.
    """
    seen: dict[str, int] = {}
    turns: list[tuple[int, VariantRate]] = []
    for one in configurations:
        if one.rate.rate:
            cause = cause_key(one.reason)
            turns.append((seen.get(cause, 0), one))
            seen[cause] = seen.get(cause, 0) + 1
    return [one for _, one in sorted(turns, key=lambda turn: turn[0])[:most]]


def _within(room: int, worst: Iterable[Worst]) -> list[Worst]:
    """The same with as many pictures as there is room for [bytes]."""
    found = []
    for one in worst:
        size = len(one.picture.encode())
        if size > room:
            left_out = f"Its map would add {size // 1000} kB to the report."
            found.append(Worst(one.rate, one.variant, one.run, one.ending, "", left_out))
        else:
            found.append(one)
            room -= size
    return found
