"""How a campaign went, as text or JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from robovast.base.printable import printable_json
from robovast.base.sequential import State
from robovast.base.statistics import LEVEL, interval_text, percent
from robovast.campaign.decisions import summed_up, told
from robovast.campaign.failure_groups import FailureGroup
from robovast.campaign.verdict import Verdict
from robovast.evaluation.effects import Effect, Side
from robovast.evaluation.rates import MOST_RUNS, CampaignRates, Rate, VariantRate
from robovast_cli.ui.listing import WIDEST_CELL, format_table
from robovast_cli.ui.output import say_data

Format = Literal["text", "json"]

_COLUMNS = ["CONFIGURATION", "STATE", "NOT PASSED", "RATE", "95 % INTERVAL", "MORE RUNS", "REASON"]
_CAUSE_COLUMNS = ["RUNS", "CAUSE", "VERDICT", "FIRST"]
_EFFECT_COLUMNS = [
    "FACTOR",
    "WORSE WHERE",
    "NOT PASSED",
    "OTHERWISE",
    "DIFFERENCE (95 %)",
    "BY CHANCE",
]
_CHANCE = "No factor explains the failures better than chance.\n"
_ANYTIME = (
    "Runs are missing, so the intervals are such that hold however often one looks meanwhile."
)


@dataclass(frozen=True)
class Findings:
    """What is known of a campaign."""

    rates: CampaignRates
    causes: Sequence[FailureGroup[str]]
    """Runs that did not pass, by cause."""
    effects: Sequence[Effect]


def print_summary(findings: Findings, output: Format, worst: int) -> None:
    """Print how a campaign went.

    Args:
        findings: what is known of the campaign.
        output: how.
        worst: number of configurations, and of causes, in the text; 0 means all.
    """
    say_data(_json(findings) if output == "json" else _text(findings, worst))


def _json(findings: Findings) -> str:
    rates, summary = findings.rates, findings.rates.summary
    data: dict[str, Any] = {
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
    }
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"


def _text(findings: Findings, worst: int) -> str:
    rates = findings.rates
    shown = rates.configurations[: worst or None]
    left = rates.configurations[len(shown) :]
    table = format_table(_COLUMNS, map(_row, shown))
    more = f"… and {len(left)} more: {_states(left)} (`-n 0` shows all)\n" if left else ""
    return f"{table}{more}\n{_causes(findings.causes, worst)}{_effects(findings)}{_counts(rates)}"


def _causes(causes: Sequence[FailureGroup[str]], most: int) -> str:
    if not causes:
        return ""
    shown = causes[: most or None]
    rows = [
        [str(len(group.runs)), group.cause[:WIDEST_CELL], ", ".join(group.verdicts), group.runs[0]]
        for group in shown
    ]
    left = len(causes) - len(shown)
    more = f"… and {left} more causes (`-n 0` shows all)\n" if left else ""
    return f"{format_table(_CAUSE_COLUMNS, rows)}{more}\n"


def _effects(findings: Findings) -> str:
    """The factors that explain failures; chance explains the others."""
    clear = [effect for effect in findings.effects if effect.p < LEVEL]
    if clear:
        return f"{format_table(_EFFECT_COLUMNS, map(_effect, clear))}\n"
    return _CHANCE if findings.effects else ""


def _effect(effect: Effect) -> list[str]:
    return [
        " = ".join([effect.factor, *effect.same])[:WIDEST_CELL],
        effect.worse.condition[:WIDEST_CELL],
        _side(effect.worse),
        _side(effect.better),
        f"{100 * effect.low:+.0f} to {100 * effect.high:+.0f} points",
        f"{effect.p:.1g}",
    ]


def _side(side: Side) -> str:
    return f"{percent(side.rate)} of {side.runs}"


def _row(variant: VariantRate) -> list[str]:
    rate = variant.rate
    return [
        variant.name,
        variant.state if variant.decision is None else told(variant.decision),
        f"{rate.failed + rate.errored} of {rate.runs}",
        "–" if rate.rate is None else percent(rate.rate),
        interval_text(rate.interval),
        _more_runs(variant),
        variant.reason[:WIDEST_CELL],
    ]


def _more_runs(variant: VariantRate) -> str:
    if variant.decision is not None:
        return f"at least {variant.decision.further}" if variant.decision.further else ""
    if variant.state is not State.UNDECIDED:
        return ""
    return f"> {MOST_RUNS}" if variant.more_runs is None else str(variant.more_runs)


def _counts(rates: CampaignRates) -> str:
    summary = rates.summary
    stored = sum(summary.counts.values())
    verdicts = ", ".join(f"{summary.counts[verdict]} {verdict}" for verdict in Verdict)
    reused = f"; reused {summary.reused} of {stored}" if summary.reused else ""
    lines = [
        f"{len(rates.configurations)} configurations: {_states(rates.configurations)} "
        f"({_measure(rates)})",
        f"{stored} of {summary.planned} runs stored: {verdicts}{reused}",
        _overall(rates.overall),
    ]
    if summary.test is not None:
        lines.insert(1, _needed(rates))
    elif rates.method == "anytime":
        lines.append(_ANYTIME)
    return "\n".join(lines) + "\n"


def _measure(rates: CampaignRates) -> str:
    """What makes configurations sound or broken."""
    test = rates.summary.test
    if test is None:
        return f"limit {percent(rates.limit)} of the runs"
    return (
        f"decided between {percent(test.good)} and {percent(test.bad)}, each wrong in at most "
        f"{percent(test.error)} of all cases"
    )


def _needed(rates: CampaignRates) -> str:
    """`70 sound after 18-41, 30 broken after 3; 1,740 of 5,000 runs needed`."""
    test = rates.summary.test
    decisions = [one.decision for one in rates.configurations if one.decision is not None]
    most = len(decisions) * ((test and test.most) or 0)
    needed = sum(decision.runs for decision in decisions)
    return f"{summed_up(decisions)}; {needed:,} of {most:,} runs needed"


def _overall(rate: Rate) -> str:
    if rate.rate is None:
        return "No run has a verdict."
    return (
        f"{percent(rate.rate)} of the runs did not pass "
        f"(95 % interval {interval_text(rate.interval)})"
    )


def _states(variants: Iterable[VariantRate]) -> str:
    states = [variant.state for variant in variants]
    return ", ".join(f"{states.count(state)} {state}" for state in State)
