"""Whether a search has ended, and why: what its section says of what is stored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robovast.model.document.search.criteria import Criterion, SearchProgress, criteria
from robovast.model.document.search.section import (
    BatchBudget,
    BudgetItem,
    Search,
    SearchObjective,
)
from robovast.search.history import SearchHistory
from robovast.search.types import Evaluation

NOTHING_NEW = 3
"""Batches in a row without a new run after which nothing is left to try."""


@dataclass(frozen=True)
class Stop:
    """Why a search ended."""

    kind: str
    """The criterion's key; `exhausted`, `errors` or `strategy` where none was reached."""
    reason: str


def until_batches(search: Search, batches: int | None) -> Search:
    """The search that ends after so many batches instead, whatever is reached; None changes
    nothing."""
    if batches is None:
        return search
    budget = [BudgetItem(batches=BatchBudget(value=batches))]
    return search.model_copy(update={"budget": budget, "stopping": []})


def best_after(
    objective: SearchObjective, evaluations: Iterable[Evaluation], before: float | None
) -> float | None:
    """The best value of an objective after a batch; None as long as there is none."""
    better = max if objective.direction == "maximize" else min
    values = [ev.objectives[objective.name] for ev in evaluations]
    return better([*([] if before is None else [before]), *values], default=None)


def best_values(objective: SearchObjective, history: SearchHistory) -> list[float | None]:
    """The best value of an objective after each batch."""
    best: list[float | None] = []
    for batch in history.finished:
        evaluations = history.evaluations(batch)
        best.append(best_after(objective, evaluations, best[-1] if best else None))
    return best


def reached(
    search: Search, history: SearchHistory, best: Sequence[float | None], further: int = 0
) -> list[Criterion]:
    """How far the criteria are after the last batch that was scored, or after further ones."""
    done = history.finished
    metrics = done[-1].outcome.metrics if done and done[-1].outcome else {}
    return criteria(search, SearchProgress(len(done) + further, history.elapsed, best, metrics))


def ending(search: Search, history: SearchHistory, best: Sequence[float | None]) -> Stop | None:
    """Why a search has ended, unless its strategy says so; None while it has not.

    Args:
        search: its section.
        history: what is stored of it.
        best: the best value of the first objective after each batch.
    """
    fired = next((one for one in reached(search, history, best) if one.fired), None)
    if fired is not None:
        return Stop(fired.kind, fired.reason)
    failed = [score for score in history.scores().values() if score.error]
    if len(failed) > search.max_errors:
        return Stop("errors", f"{len(failed)} sets could not be evaluated: {failed[-1].error}")
    last = history.finished[-NOTHING_NEW:]
    if last and not last[-1].proposal.sets:
        return Stop("exhausted", "the strategy has nothing left to propose")
    if len(last) == NOTHING_NEW and not any(batch.blocks for batch in last):
        return Stop("exhausted", f"{NOTHING_NEW} batches in a row proposed nothing new")
    return None
