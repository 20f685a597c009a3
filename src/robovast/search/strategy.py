"""The base class of strategies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

from pydantic import BaseModel

from robovast.model.document.search.section import Search, SearchObjective
from robovast.model.document.search.space import place, values_at
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
        """Learn from the evaluations of the oldest sets that were asked for and not yet told."""

    @abstractmethod
    def report(self) -> SearchReport:
        """Return what was found so far."""

    @property
    def needed_measures(self) -> frozenset[str]:
        """Measures without which an evaluation is no use; the extractor must give them."""
        return frozenset()

    def is_done(self) -> bool:
        """Whether the strategy wants the search to end."""
        return False

    @property
    def asks_ahead(self) -> bool:
        """Whether it can be asked for a batch while the one before is still executed.

        If so, an answer without a set leaves no trace: it is asked again when it knows more.
        """
        return False

    @property
    def fills(self) -> bool:
        """Whether no result could change the next batch, since it only fills the space.

        If so, and if it can be asked ahead, it is asked before any batch was evaluated.
        """
        return False

    def repeat(self, n: int, asked: Sequence[ParamSet]) -> None:
        """Answer a stored question again."""
        del asked
        self.ask(n)

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

    METRICS = frozenset({"batches", "evaluations"})

    def __init__(self, cfg: Search, params: Any = None) -> None:
        super().__init__(cfg, params)
        self.batch = 0
        """Number of the next batch: how often it has proposed something."""
        self.evaluated = 0
        """Number of batches whose evaluations are known."""
        self._open: deque[Sequence[ParamSet]] = deque()
        """The batches that were proposed and are not evaluated."""
        self.asked: dict[str, ParamSet] = {}
        """All sets that were ever proposed, by identifier."""
        self.known: dict[str, Evaluation] = {}
        """The last evaluation of each set, in the order of the first ones."""
        self.seed = cfg.seed % 2**64
        """The document's seed as generators take it: never negative."""

    @abstractmethod
    def propose(self, n: int) -> list[ParamSet]:
        """Propose parameter sets from seed, number of the batch and history."""

    def ask(self, n: int) -> list[ParamSet]:
        """Propose and remember parameter sets."""
        proposed = self.propose(n)
        self._remember(proposed)
        return proposed

    @property
    def asks_ahead(self) -> bool:
        """It learns from what is evaluated, whatever is under way."""
        return True

    @property
    def open(self) -> dict[str, ParamSet]:
        """The sets that are executed now, by identifier."""
        return {params.id: params for sets in self._open for params in sets}

    def repeat(self, n: int, asked: Sequence[ParamSet]) -> None:
        """Remember a stored batch without computing it again."""
        del n
        self._remember(asked)

    def _remember(self, proposed: Sequence[ParamSet]) -> None:
        self.asked.update((params.id, params) for params in proposed)
        if proposed:
            self.batch += 1
            self._open.append(proposed)

    def tell(self, evaluations: list[Evaluation]) -> None:
        """Remember evaluations."""
        self.known.update((ev.params.id, ev) for ev in evaluations)
        self.evaluated += 1
        if self._open:
            self._open.popleft()

    def place(self, params: ParamSet) -> list[float]:
        """A set's place in the unit cube."""
        return [place(dim, params.values[name]) for name, dim in self.search_space.items()]

    def set_at(self, unit: Iterable[float]) -> ParamSet:
        """The set at a place of the unit cube."""
        units = dict(zip(self.search_space, unit, strict=True))
        return ParamSet(values_at(self.search_space, units))

    def report(self) -> SearchReport:
        """All evaluations, the best first; of several objectives, those that none beats."""
        known = list(self.known.values())
        extra = {"batches": self.evaluated, "evaluations": len(known)}
        if len(self.objectives) > 1:
            front = unbeaten(self.objectives, known)
            ids = {ev.params.id for ev in front}
            others = [ev for ev in known if ev.params.id not in ids]
            return SearchReport([*front, *others], front=front, extra=extra)
        ranked = sorted(known, key=self.objective_value, reverse=True)
        return SearchReport(ranked, ranked[0] if ranked else None, extra=extra)


def unbeaten(
    objectives: Sequence[SearchObjective], evaluations: Iterable[Evaluation]
) -> list[Evaluation]:
    """The evaluations that no other reaches in all objectives and beats in one."""
    signs = {o.name: -1 if o.direction == "maximize" else 1 for o in objectives}
    losses = [(tuple(s * e.objectives[n] for n, s in signs.items()), e) for e in evaluations]
    front: list[tuple[tuple[float, ...], Evaluation]] = []
    for loss, evaluation in sorted(losses, key=lambda item: item[0]):
        beaten = any(
            other != loss and all(a <= b for a, b in zip(other, loss, strict=True))
            for other, _ in front
        )
        if not beaten:
            front.append((loss, evaluation))
    return [evaluation for _, evaluation in front]
