"""When a search ends: its criteria, and how far each of them is."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from robovast.model.document.search.section import MetricReached, NoImprovement, Search

_OPERATIONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "<": operator.lt,
}


@dataclass(frozen=True)
class SearchProgress:
    """What a search has reached after a batch."""

    batches: int
    elapsed: float
    """[s]"""
    best: Sequence[float | None] = ()
    """The best value of the objective after each batch; None as long as there is none."""
    metrics: Mapping[str, float] = field(default_factory=dict)
    """The numbers in the strategy's report."""


@dataclass(frozen=True)
class Criterion:
    """How far one criterion is."""

    kind: str
    """The document's key."""
    label: str
    """The name of the compared number."""
    current: float | None
    limit: float
    fired: bool

    def __str__(self) -> str:
        """`batches 3/50`."""
        current = "-" if self.current is None else f"{self.current:.6g}"
        return f"{self.label} {current}/{self.limit:.6g}"

    @cached_property
    def reason(self) -> str:
        """Why the search ended."""
        return f"{self.kind}: {self}"


def criteria(search: Search, progress: SearchProgress) -> list[Criterion]:
    """All criteria of a search: the budget in the document's order, then what stops it."""
    return [*_budget(search, progress), *_stopping(search, progress)]


def _budget(search: Search, progress: SearchProgress) -> Iterator[Criterion]:
    for item in search.budget:
        if item.batches is not None:
            done, limit = progress.batches, item.batches.value
            yield Criterion("batches", "batches", done, limit, done >= limit)
        if item.time is not None:
            elapsed, seconds = round(progress.elapsed, 1), item.time.seconds
            yield Criterion("time", "time", elapsed, seconds, progress.elapsed >= seconds)


def _stopping(search: Search, progress: SearchProgress) -> Iterator[Criterion]:
    objective = search.objectives[0]
    sign = 1 if objective.direction == "maximize" else -1
    best = progress.best[-1] if progress.best else None
    for item in search.stopping:
        if item.target_objective is not None:
            limit = item.target_objective.value
            fired = best is not None and sign * best >= sign * limit
            yield Criterion("target_objective", objective.name, best, limit, fired)
        if item.no_improvement is not None:
            yield _no_improvement(item.no_improvement, sign, progress.best)
        if item.metric is not None:
            yield _metric(item.metric, progress.metrics.get(item.metric.name))


def _no_improvement(item: NoImprovement, sign: int, best: Sequence[float | None]) -> Criterion:
    """For how many batches the best value is not better by more than `min_delta`."""
    last = best[-1] if best else None
    earlier = [value for value in best[:-1] if value is not None]
    stale = sum(last is not None and sign * (last - v) <= item.min_delta for v in earlier)
    fired = stale >= item.patience
    return Criterion("no_improvement", "stale_batches", stale, item.patience, fired)


def _metric(item: MetricReached, current: float | None) -> Criterion:
    fired = current is not None and _OPERATIONS[item.op](current, item.value)
    return Criterion("metric", item.name, current, item.value, fired)
