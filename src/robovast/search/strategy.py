"""The base class of strategies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from pydantic import BaseModel

from robovast.model.document.model import Search, SearchObjective
from robovast.search.types import Evaluation, ParamSet, SearchReport

__all__ = ["Evaluation", "HistoryStrategy", "ParamSet", "SearchReport", "SearchStrategy"]


class SearchStrategy(ABC):
    """Proposes parameter sets, and learns from their evaluations.

    A strategy is rebuilt whenever a search continues: it must propose the same sets again when it
    is made with the same seed, asked the same questions and told the same evaluations.

    Args:
        cfg: the document's `search` section.
        params: `strategy_parameters`, checked by `PARAMS_MODEL` if there is one.
    """

    PARAMS_MODEL: ClassVar[type[BaseModel] | None] = None
    """Model of `strategy_parameters`."""
    SINGLE_OBJECTIVE: ClassVar[bool] = False
    """Whether more than one objective is refused."""
    METRICS: ClassVar[frozenset[str] | None] = None
    """Numbers in the report that criteria may name; None means unknown."""

    def __init__(self, cfg: Search, params: Any = None) -> None:
        self.cfg = cfg
        self.params = params
        self.search_space = cfg.search_space
        self.objectives = cfg.objectives

    @abstractmethod
    def ask(self, n: int) -> list[ParamSet]:
        """Propose at most `n` parameter sets; none means that there is nothing left to try."""

    @abstractmethod
    def tell(self, evaluations: list[Evaluation]) -> None:
        """Learn from the evaluations of the sets that were asked for last."""

    @abstractmethod
    def report(self) -> SearchReport:
        """Return what was found so far."""

    def is_done(self) -> bool:
        """Whether the strategy wants the search to end."""
        return False

    def replay(self, n: int, asked: Sequence[ParamSet], evaluations: list[Evaluation]) -> None:
        """Repeat a stored batch."""
        del asked
        self.ask(n)
        self.tell(evaluations)

    @property
    def single_objective(self) -> SearchObjective:
        """The only objective.

        Raises:
            ValueError: there are several.
        """
        if len(self.objectives) != 1:
            raise ValueError(f"the search has {len(self.objectives)} objectives, not one")
        return self.objectives[0]

    def objective_value(self, ev: Evaluation) -> float:
        """The value of the only objective, negated when it is minimized: higher is better."""
        value = ev.objectives[self.single_objective.name]
        return value if self.single_objective.direction == "maximize" else -value


class HistoryStrategy(SearchStrategy):
    """A strategy that is a function of seed and history: it keeps nothing else."""

    SINGLE_OBJECTIVE = True
    METRICS = frozenset({"batches", "evaluations"})

    def __init__(self, cfg: Search, params: Any = None) -> None:
        super().__init__(cfg, params)
        self.batch = 0
        """Number of the next batch."""
        self.asked: dict[str, ParamSet] = {}
        """All sets that were ever proposed, by identifier."""
        self.known: dict[str, Evaluation] = {}
        """The last evaluation of each set, in the order of the first ones."""

    @abstractmethod
    def propose(self, n: int) -> list[ParamSet]:
        """Propose parameter sets from seed, number of the batch and history."""

    def ask(self, n: int) -> list[ParamSet]:
        """Propose and remember parameter sets."""
        proposed = self.propose(n)
        self.asked.update((params.id, params) for params in proposed)
        return proposed

    def tell(self, evaluations: list[Evaluation]) -> None:
        """Remember evaluations."""
        self.known.update((ev.params.id, ev) for ev in evaluations)
        self.batch += 1

    def replay(self, n: int, asked: Sequence[ParamSet], evaluations: list[Evaluation]) -> None:
        """Remember a stored batch without computing it again."""
        del n
        self.asked.update((params.id, params) for params in asked)
        self.tell(evaluations)

    def report(self) -> SearchReport:
        """All evaluations, the best first."""
        ranked = sorted(self.known.values(), key=self.objective_value, reverse=True)
        extra = {"batches": self.batch, "evaluations": len(ranked)}
        return SearchReport(ranked, ranked[0] if ranked else None, extra=extra)
