"""How a campaign went, as text or JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any, Literal

from robovast.campaign.verdict import Verdict
from robovast.evaluation.rates import MOST_RUNS, CampaignRates, Rate, State, VariantRate
from robovast_cli.ui.listing import WIDEST_CELL, format_table
from robovast_cli.ui.output import say_data

Format = Literal["text", "json"]

_COLUMNS = ["CONFIGURATION", "STATE", "NOT PASSED", "RATE", "95 % INTERVAL", "MORE RUNS", "REASON"]
_ANYTIME = (
    "Runs are missing, so the intervals are such that hold however often one looks meanwhile."
)


def print_summary(rates: CampaignRates, output: Format, worst: int) -> None:
    """Print how a campaign went.

    Args:
        rates: the campaign.
        output: how.
        worst: number of configurations in the text; 0 means all.
    """
    say_data(_json(rates) if output == "json" else _text(rates, worst))


def percent(share: float) -> str:
    """A share as people read it: `7.5 %`, `12 %`."""
    value = 100 * share
    return f"{value:.1f} %" if 0 < value < 10 else f"{value:.0f} %"


def interval_text(low: float, high: float) -> str:
    """An interval of shares: `3.6 – 62 %`."""
    return f"{percent(low).removesuffix(' %')} – {percent(high)}"


def _json(rates: CampaignRates) -> str:
    summary = rates.summary
    data: dict[str, Any] = {
        "campaign": summary.name,
        "state": summary.state,
        "planned": summary.planned,
        "runs": summary.counts,
        "limit": rates.limit,
        "interval": rates.method,
        "states": rates.states,
        "overall": asdict(rates.overall),
        "configurations": [asdict(variant) for variant in rates.configurations],
    }
    return json.dumps(data, indent=1, ensure_ascii=False) + "\n"


def _text(rates: CampaignRates, worst: int) -> str:
    shown = rates.configurations[: worst or None]
    left = rates.configurations[len(shown) :]
    table = format_table(_COLUMNS, map(_row, shown))
    more = f"… and {len(left)} more: {_states(left)} (`-n 0` shows all)\n" if left else ""
    return f"{table}{more}\n{_counts(rates)}"


def _row(variant: VariantRate) -> list[str]:
    rate = variant.rate
    return [
        variant.name,
        variant.state,
        f"{rate.failed + rate.errored} of {rate.runs}",
        "–" if rate.rate is None else percent(rate.rate),
        interval_text(*rate.interval),
        _more_runs(variant),
        variant.reason[:WIDEST_CELL],
    ]


def _more_runs(variant: VariantRate) -> str:
    if variant.state is not State.UNDECIDED:
        return ""
    return f"> {MOST_RUNS}" if variant.more_runs is None else str(variant.more_runs)


def _counts(rates: CampaignRates) -> str:
    summary = rates.summary
    stored = sum(summary.counts.values())
    verdicts = ", ".join(f"{summary.counts[verdict]} {verdict}" for verdict in Verdict)
    lines = [
        f"{len(rates.configurations)} configurations: {_states(rates.configurations)} "
        f"(limit {percent(rates.limit)} of the runs)",
        f"{stored} of {summary.planned} runs stored: {verdicts}",
        _overall(rates.overall),
    ]
    if rates.method == "anytime":
        lines.append(_ANYTIME)
    return "\n".join(lines) + "\n"


def _overall(rate: Rate) -> str:
    if rate.rate is None:
        return "No run has a verdict."
    return (
        f"{percent(rate.rate)} of the runs did not pass "
        f"(95 % interval {interval_text(*rate.interval)})"
    )


def _states(variants: Iterable[VariantRate]) -> str:
    states = [variant.state for variant in variants]
    return ", ".join(f"{states.count(state)} {state}" for state in State)
