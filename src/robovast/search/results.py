"""What a stored search found, as tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple
from pathlib import Path
from typing import Any

from robovast.analysis.tables.query import Answer
from robovast.base.errors import InputError
from robovast.base.plugins import plugin_errors, raised
from robovast.campaign.configurations import read_configurations
from robovast.campaign.layout import Layout
from robovast.model.document import Document, load_document
from robovast.model.document.search.space import holds, place
from robovast.search.history import Batch, History
from robovast.search.plugins import make_strategy, search_of
from robovast.search.strategy import SearchStrategy, unbeaten


class StoredSearch:
    """A search, finished or under way.

    Args:
        campaign: its folder.

    Raises:
        InputError: the folder is no search, or nothing of it was scored yet.
    """

    def __init__(self, campaign: Path) -> None:
        layout = Layout(campaign)
        name = str(read_configurations(layout).get("vast"))
        self.document: Document = load_document(layout.config / name)
        self.search = search_of(self.document)
        self.history = History(layout)
        self.history.check(self.search)
        if not self.history.finished:
            raise InputError(f"{campaign}: no batch of the search is finished yet.")

    def strategy(self) -> SearchStrategy:
        """The strategy after all batches that were scored.

        Raises:
            InputError: it raises.
        """
        made = make_strategy(self.document)
        for batch in self.history.finished:
            evaluations = self.history.evaluations(batch)
            with plugin_errors(self._replay_failed):
                made.replay(batch.proposal.asked, batch.proposal.sets, evaluations)
        return made

    def _replay_failed(self, error: BaseException) -> InputError:
        name = self.search.strategy
        return InputError(
            f"{self.document.path}: the strategy `{name}`: `replay` raised {raised(error)}."
        )

    def sets(self) -> Answer:
        """All evaluated sets, a row each time that one was proposed."""
        scores = [score for score in self.history.scores().values() if not score.error]
        numbers = sorted({name for s in scores for name in (*s.objectives, *s.measures)})
        columns = ["batch", "config", *self.search.search_space, *numbers, "n_samples", "error"]
        rows = [row for batch in self.history.finished for row in self._rows(batch, numbers)]
        return Answer(columns, rows)

    def _rows(self, batch: Batch, numbers: list[str]) -> list[tuple[Any, ...]]:
        scores = {score.id: score for score in batch.outcome.scores} if batch.outcome else {}
        rows = []
        for params, config in zip(batch.proposal.sets, batch.proposal.configs, strict=True):
            score = scores[params.id]
            given = {**score.measures, **score.objectives}
            values = [params.values[name] for name in self.search.search_space]
            found = [given.get(name) for name in numbers]
            rows.append((batch.number, config, *values, *found, score.n_samples, score.error))
        return rows

    def report(self) -> Answer:
        """The numbers of the strategy's report after each batch."""
        outcomes = [(b.number, b.outcome) for b in self.history.finished if b.outcome is not None]
        names = list(dict.fromkeys(name for _, o in outcomes for name in o.metrics))
        rows = [
            (number, *(o.metrics.get(name) for name in names), o.elapsed) for number, o in outcomes
        ]
        return Answer(["batch", *names, "elapsed"], rows)

    def critical(self, fixed: Mapping[str, Any]) -> Answer:
        """The critical value of each number, the other parameters being fixed.

        Raises:
            InputError: the strategy makes no failure map, or a fixed value is not in the space.
        """
        self.middle(fixed)
        columns = ["parameter", "critical", "low", "high", "crossing"]
        return Answer(columns, [astuple(item) for item in self.failure_map().critical(fixed)])

    def middle(self, fixed: Mapping[str, Any]) -> list[float]:
        """The place of fixed values in the unit cube, in the middle of all other dimensions.

        Raises:
            InputError: a fixed value is not in the space.
        """
        space = self.search.search_space
        for name, value in fixed.items():
            if name not in space:
                raise InputError(f"`{name}` is no dimension of the search space.")
            if not holds(space[name], value):
                raise InputError(f"{name} = {value!r} is not in the search space.")
        return [place(dim, fixed[name]) if name in fixed else 0.5 for name, dim in space.items()]

    def map(self) -> Answer:
        """The rate of failures at points all over the space, each with its 95 % interval.

        Raises:
            InputError: the strategy makes no failure map.
        """
        columns = [*self.search.search_space, "failure_rate", "low", "high"]
        return Answer(columns, list(self.failure_map().rows()))

    def archive(self) -> Answer:
        """The best set of each cell of the archive, its cell's number first.

        Raises:
            InputError: the strategy keeps no archive.
        """
        strategy = self.strategy()
        if not hasattr(strategy, "elites"):
            raise InputError(f"the strategy `{self.search.strategy}` keeps no archive; `qd` does.")
        configs, space = self.history.configs(), self.search.search_space
        axes = sorted(strategy.needed_measures)
        objective = strategy.single_objective.name
        rows = [
            (
                cell,
                configs[ev.params.id],
                *(ev.params.values[name] for name in space),
                ev.objectives[objective],
                *(ev.measures[name] for name in axes),
            )
            for cell, ev in sorted(strategy.elites.items())
        ]
        return Answer(["cell", "config", *space, objective, *axes], rows)

    def best(self) -> Answer:
        """The best set, or those of several objectives that no other beats in all of them."""
        configs, space = self.history.configs(), self.search.search_space
        names = [objective.name for objective in self.search.objectives]
        found = [ev for batch in self.history.finished for ev in self.history.evaluations(batch)]
        last = {ev.params.id: ev for ev in found}
        rows = [
            (
                configs[ev.params.id],
                *(ev.params.values[name] for name in space),
                *(ev.objectives[name] for name in names),
                ev.n_samples,
            )
            for ev in unbeaten(self.search.objectives, last.values())
        ]
        return Answer(["config", *space, *names, "n_samples"], rows)

    def failure_map(self) -> Any:
        """The map of the strategy.

        Raises:
            InputError: the strategy makes no failure map.
        """
        strategy = self.strategy()
        if not hasattr(strategy, "map"):
            raise InputError(
                f"the strategy `{self.search.strategy}` makes no failure map; `boundary` does."
            )
        return strategy.map()
