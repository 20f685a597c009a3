"""Summarize the results of a search in a few lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from robovast.campaign.layout import Layout
from robovast.execution.local import recorded_seed
from robovast.search.local import SearchSummary
from robovast.search.scoring import NO_VERDICT


def search_lines(summary: SearchSummary) -> Iterator[str]:
    """Describe why a search stopped, and its best set; a search looks for failed runs."""
    if summary.stop is not None:
        yield f"The search stopped: {summary.stop.reason}."
    if summary.errors:
        yield (
            f"{len(summary.errors)} of {summary.sets} parameter sets were skipped because their "
            f"runs could not be scored; the last: {summary.errors[-1]}"
        )
    if any(error != NO_VERDICT for error in summary.errors):
        seed = recorded_seed(Layout(summary.campaign))
        yield (
            "To score the stored runs with a corrected extractor, start a new search with "
            f"`seed: {seed}` in `execution` and with `--reuse`."
        )
    if summary.report and (best := summary.report.best) is not None:
        evaluations = summary.report.evaluations
        equal = len({ev.params.id for ev in evaluations if ev.objectives == best.objectives})
        others = f" (one of {equal:,} equally good sets)" if equal > 1 else ""
        yield f"Best: {listed(best.objectives)} with {listed(best.params.values)}{others}"


def listed(values: Mapping[str, Any]) -> str:
    """Return `speed 1.25, load 3`."""
    return ", ".join(f"{name} {shown_number(value)}" for name, value in values.items())


def shown_number(value: object) -> str:
    """Return a value with at most six digits."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
