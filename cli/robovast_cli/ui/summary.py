"""Failure rates, causes and factors of a campaign as text or JSON."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from robovast.base.sequential import State
from robovast.base.statistics import LEVEL, interval_text, percent
from robovast.campaign.decisions import describe_decision, runs_needed
from robovast.campaign.failure_groups import FailureGroup
from robovast.campaign.verdict import Verdict
from robovast.evaluation.effects import Effect, Side
from robovast.evaluation.launch.commands import as_shell, more_runs_words, resume_words
from robovast.evaluation.rates import (
    MOST_RUNS,
    CampaignRates,
    Rate,
    VariantRate,
    soonest_decided,
    why_wider,
)
from robovast_cli.ui.output import echo_data, echo_json
from robovast_cli.ui.table import WIDEST_CELL, WIDEST_REASON, counted, format_table, shortened

Format = Literal["text", "json"]

COLUMNS = ["CONFIGURATION", "STATE", "UNSUCCESSFUL", "RATE", "95 % INTERVAL", "MORE RUNS", "REASON"]
CAUSE_COLUMNS = ["RUNS", "CAUSE", "VERDICT", "FIRST RUN"]
EFFECT_COLUMNS = [
    "FACTOR",
    "WORSE IF",
    "UNSUCCESSFUL",
    "ELSEWHERE",
    "PERCENTAGE POINTS (95 %)",
    "P-VALUE",
]
CHANCE = "No factor explains the failures better than chance.\n"


@dataclass(frozen=True)
class SummaryFindings:
    """Rates, causes and effects of a campaign."""

    results: Path | None
    """The results folder; None if the campaign is in a bucket."""
    rates: CampaignRates
    causes: Sequence[FailureGroup[str]]
    """Unsuccessful runs, by cause."""
    effects: Sequence[Effect]
    batches: Sequence[str] = ()
    """Arguments of the command that resumes a search."""


def print_summary(findings: SummaryFindings, output: Format, worst: int) -> None:
    """Print the summary of a campaign, with at most `worst` lines in each table (0: all)."""
    if output == "json":
        echo_json(_data(findings))
    else:
        echo_data(_text(findings, worst))


def _data(findings: SummaryFindings) -> dict[str, Any]:
    rates, summary = findings.rates, findings.rates.summary
    return {
        "campaign": summary.name,
        "state": summary.state,
        "planned": summary.planned,
        "runs": summary.counts,
        "reused": summary.reused,
        "limit": rates.limit,
        "interval": rates.method,
        "states": rates.states,
        "overall": asdict(rates.overall),
        "causes": [asdict(group) for group in findings.causes],
        "effects": [asdict(effect) for effect in findings.effects],
        "configurations": [asdict(variant) for variant in rates.configurations],
        "next": as_shell(_next(findings)),
    }


def _text(findings: SummaryFindings, worst: int) -> str:
    rates = findings.rates
    shown = rates.configurations[: worst or None]
    left = rates.configurations[len(shown) :]
    table = format_table(COLUMNS, map(_short_row, shown))
    more = f"… and {len(left)} more: {_states(left)} (`--worst 0` shows all)\n" if left else ""
    return (
        f"{table}{more}\n{_causes(findings.causes, worst)}{_effects(findings)}{counts_text(rates)}"
        f"{_remedy(findings)}"
    )


def _remedy(findings: SummaryFindings) -> str:
    """Return the command that resumes the campaign, or adds the most useful runs."""
    command = as_shell(_next(findings))
    if not command:
        return ""
    summary, nearest = findings.rates.summary, soonest_decided(findings.rates)
    if summary.is_search or summary.state != "finished" or nearest is None:
        return f"Continue: {command}\n"
    needed = f"needs the fewest runs for a decision ({nearest.more_runs} more)"
    return f"{nearest.name} {needed}: {command}\n"


def _next(findings: SummaryFindings) -> Sequence[str]:
    """Return the command for missing runs, or for the fewest runs that give a decision."""
    summary, nearest = findings.rates.summary, soonest_decided(findings.rates)
    if findings.results is None or summary.is_search:
        return findings.batches
    if summary.state != "finished":
        return resume_words(findings.results, summary)
    if nearest is None:
        return []
    total = nearest.rate.runs + (nearest.more_runs or 0)
    return more_runs_words(findings.results, summary, [nearest.name], total)


def _causes(causes: Sequence[FailureGroup[str]], most: int) -> str:
    if not causes:
        return ""
    shown = causes[: most or None]
    rows = [
        [
            str(len(group.runs)),
            shortened(group.text, WIDEST_REASON),
            ", ".join(group.verdicts),
            group.runs[0],
        ]
        for group in shown
    ]
    left = len(causes) - len(shown)
    more = f"… and {left} more causes (`--worst 0` shows all)\n" if left else ""
    return f"{format_table(CAUSE_COLUMNS, rows)}{more}\n"


def _effects(findings: SummaryFindings) -> str:
    """Return the table of factors with a p-value below 5 %."""
    clear = clear_effects(findings.effects)
    if clear:
        return f"{format_table(EFFECT_COLUMNS, map(effect_row, clear))}\n"
    return CHANCE if findings.effects else ""


def clear_effects(effects: Iterable[Effect]) -> list[Effect]:
    """Return the effects with a p-value below 5 %."""
    return [effect for effect in effects if effect.p < LEVEL]


def effect_row(effect: Effect) -> list[str]:
    """Cells for `EFFECT_COLUMNS`."""
    return [
        shortened(" = ".join([effect.factor, *effect.same]), WIDEST_CELL),
        shortened(effect.worse.condition, WIDEST_CELL),
        _side(effect.worse),
        _side(effect.better),
        f"{100 * effect.low:+.0f} to {100 * effect.high:+.0f}",
        f"{effect.p:.1g}",
    ]


def _side(side: Side) -> str:
    return f"{percent(side.rate)} of {side.runs}"


def _short_row(variant: VariantRate) -> list[str]:
    *cells, reason = configuration_row(variant)
    return [*cells, shortened(reason, WIDEST_REASON)]


def configuration_row(variant: VariantRate) -> list[str]:
    """Cells for `COLUMNS`."""
    rate = variant.rate
    return [
        variant.name,
        variant.state.word if variant.decision is None else describe_decision(variant.decision),
        f"{rate.failed + rate.errored} of {rate.runs}",
        "–" if rate.rate is None else percent(rate.rate),
        interval_text(rate.interval),
        _more_runs(variant),
        variant.reason,
    ]


def _more_runs(variant: VariantRate) -> str:
    if variant.decision is not None:
        return f"at least {variant.decision.further}" if variant.decision.further else ""
    if variant.state is not State.UNDECIDED:
        return ""
    return f"> {MOST_RUNS}" if variant.more_runs is None else str(variant.more_runs)


def counts_text(rates: CampaignRates) -> str:
    """Count configurations by state and runs by verdict, and state the overall rate."""
    summary = rates.summary
    stored = sum(summary.counts.values())
    verdicts = ", ".join(f"{summary.counts[verdict]} {verdict}" for verdict in Verdict)
    reused = f"; reused {summary.reused} of {stored}" if summary.reused else ""
    count = len(rates.configurations)
    lines = [
        f"{counted(count, 'configuration')}: {_states(rates.configurations)} ({_measure(rates)})",
        f"{stored} of {summary.planned} runs stored: {verdicts}{reused}",
        _overall(rates.overall),
    ]
    if summary.test is not None:
        lines.insert(1, _needed(rates))
    lines += filter(None, [why_wider(summary)])
    return "\n".join(lines) + "\n"


def _measure(rates: CampaignRates) -> str:
    """Describe the rule that classifies configurations as passing or failing."""
    test = rates.summary.test
    if test is None:
        return f"threshold {percent(rates.limit)}"
    rule = test.rule
    return (
        f"sequential test between {percent(rule.good)} and {percent(rule.bad)}, "
        f"error at most {percent(rule.error)}"
    )


def _needed(rates: CampaignRates) -> str:
    """`70 passing after 18-41, 30 failing after 3; 1,740 of 5,000 runs needed`."""
    test = rates.summary.test
    decided = [one for one in rates.configurations if one.decision is not None]
    most = sum(test.planned.of(one.name) for one in decided) if test is not None else 0
    return runs_needed([one.decision for one in decided if one.decision], most)


def _overall(rate: Rate) -> str:
    if rate.rate is None:
        return "No run has a verdict."
    return (
        f"{percent(rate.rate)} of the runs were unsuccessful "
        f"(95 % interval {interval_text(rate.interval)})"
    )


def _states(variants: Iterable[VariantRate]) -> str:
    states = [variant.state for variant in variants]
    return ", ".join(f"{states.count(state)} {state.word}" for state in State)
