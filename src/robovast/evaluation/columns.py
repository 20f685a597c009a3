"""All runs of a campaign as columns, which are a tenth of the size of objects and fast to parse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from robovast.campaign.decisions import CampaignTest, describe_decision
from robovast.campaign.failure_groups import causes
from robovast.campaign.verdict import Verdict
from robovast.evaluation.summaries import VariantRuns, decision_of

VERDICTS = list(Verdict)
"""Verdicts; a verdict's index is its code."""
_TEXTS = {"host": "Host"}
"""Further columns of the web UI with a text of each run: field of `RunSummary`, and title."""


@dataclass(frozen=True)
class VariantColumns:
    """Configurations, one item of each list per configuration."""

    name: list[str]
    entry: list[str]
    values: dict[str, list[Any]]
    """Values of factors, then of the other parameters."""


@dataclass(frozen=True)
class TextColumn:
    """A text of each run; equal ones are sent once."""

    title: str
    texts: list[str]
    text: list[int]
    """The place in `texts`, by run."""


@dataclass(frozen=True)
class RunColumns:
    """Runs, one item of each list per run."""

    variant: list[int]
    """Place of the configuration."""
    number: list[int]
    verdict: list[int]
    """Place in `verdicts`."""
    reason: list[int]
    """Place in `reasons`."""
    started: list[float | None]
    """[s since the epoch]"""
    duration: list[float | None]
    """[s]"""
    texts: dict[str, TextColumn]
    """Further columns, by name; those in which all runs are equal are left out."""


@dataclass(frozen=True)
class CampaignColumns:
    """Configurations and runs of a campaign."""

    verdicts: list[Verdict]
    decided: list[str]
    """Decision of the campaign's test about each configuration, for example `passing after 18`;
    empty without one."""
    reasons: list[str]
    causes: list[str]
    """What the reasons of one cause have in common."""
    numbers: list[str]
    """By cause: the ranges of the numbers in which its reasons differ."""
    cause: list[int]
    """Place of the cause of each reason."""
    variants: VariantColumns
    factors: list[str]
    """What a person varied; the parameters where nothing else is stated."""
    units: dict[str, str]
    """Of the factors that have one."""
    runs: RunColumns


def columns(variants: Sequence[VariantRuns], test: CampaignTest | None = None) -> CampaignColumns:
    """Configurations and runs of a campaign, and what its test says of each configuration."""
    factors = list(dict.fromkeys(name for variant in variants for name in variant.factors))
    names = dict.fromkeys([*factors, *(name for v in variants for name in v.parameters)])
    runs = [(place, run) for place, variant in enumerate(variants) for run in variant.runs]
    reasons = {"": 0}
    for _, run in runs:
        reasons.setdefault(run.reason, len(reasons))
    bad = (run.reason for _, run in runs if run.verdict is not Verdict.PASSED)
    known = causes(bad)
    cause_of = causes(reason for reason in reasons if reason not in known) | known
    place_of = {cause: place for place, cause in enumerate(dict.fromkeys(cause_of.values()))}
    codes = {verdict: code for code, verdict in enumerate(VERDICTS)}
    texts = {
        name: _text_column(title, [getattr(run, name) for _, run in runs])
        for name, title in _TEXTS.items()
    }
    return CampaignColumns(
        verdicts=VERDICTS,
        decided=[describe_decision(decision_of(test, one)) for one in variants] if test else [],
        reasons=list(reasons),
        causes=[cause.label for cause in place_of],
        numbers=[cause.numbers for cause in place_of],
        cause=[place_of[cause_of[reason]] for reason in reasons],
        variants=VariantColumns(
            name=[variant.name for variant in variants],
            entry=[variant.entry for variant in variants],
            values={name: [_value(variant, name) for variant in variants] for name in names},
        ),
        factors=[name for name in factors if not name.startswith("_")],
        units={name: unit for variant in variants for name, unit in variant.units.items()},
        runs=RunColumns(
            variant=[place for place, _ in runs],
            number=[run.number for _, run in runs],
            verdict=[codes[run.verdict] for _, run in runs],
            reason=[reasons[run.reason] for _, run in runs],
            started=[_rounded(run.started_at) for _, run in runs],
            duration=[_rounded(run.duration) for _, run in runs],
            texts={name: column for name, column in texts.items() if len(column.texts) > 1},
        ),
    )


def _text_column(title: str, values: Sequence[str]) -> TextColumn:
    places: dict[str, int] = {}
    text = [places.setdefault(value, len(places)) for value in values]
    return TextColumn(title, list(places), text)


def _value(variant: VariantRuns, name: str) -> Any:
    return variant.stated[name] if name in variant.stated else variant.parameters.get(name)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
