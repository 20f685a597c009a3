"""What a stored search found, as tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.analysis.tables.query import Answer
from robovast.base.errors import InputError
from robovast.base.plugins import plugin_errors, raised
from robovast.campaign.configurations import document_path, read_configurations
from robovast.campaign.layout import Layout
from robovast.model.document import load_document
from robovast.model.document.problems import as_hint, suggest
from robovast.model.document.search.section import Search
from robovast.model.document.search.space import holds, place
from robovast.search.ending import best_values
from robovast.search.history import Batch, SearchHistory
from robovast.search.plugins import search_of, strategy_of
from robovast.search.strategy import SearchStrategy, unbeaten
from robovast.search.types import Evaluation

if TYPE_CHECKING:
    from robovast.search.strategies.failure_map import FailureMap


class StoredSearch:
    """A search, finished or under way.

    Args:
        search: its section.
        history: what is stored of it.
        document: the .vast file, whose folder has the strategy if that is users' code.

    Raises:
        InputError: what is stored is not of this search.
    """

    def __init__(self, search: Search, history: SearchHistory, document: Path) -> None:
        history.check(search)
        self.search = search
        self.history = history
        self.document = document

    @cached_property
    def strategy(self) -> SearchStrategy:
        """The strategy after all batches that were scored.

        Raises:
            InputError: it cannot be made, or raises.
        """
        made = strategy_of(self.search, self.document)
        with plugin_errors(self._replay_failed):
            self.history.replay(made)
        return made

    def _replay_failed(self, error: BaseException) -> InputError:
        name = self.search.strategy
        return InputError(
            f"{self.document}: the strategy `{name}`: `replay` raised {raised(error)}."
        )

    @cached_property
    def evaluated(self) -> dict[str, Evaluation]:
        """The last evaluation of each set that has a score, by identifier."""
        found = (ev for batch in self.history.finished for ev in self.history.evaluations(batch))
        return {ev.params.id: ev for ev in found}

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
        """The best value of each objective and the strategy's numbers after each batch."""
        outcomes = [(b.number, b.outcome) for b in self.history.finished if b.outcome is not None]
        names = list(dict.fromkeys(name for _, o in outcomes for name in o.metrics))
        best = {f"best {o.name}": best_values(o, self.history) for o in self.search.objectives}
        rows = [
            (number, *so_far, *(o.metrics.get(name) for name in names), o.elapsed)
            for (number, o), *so_far in zip(outcomes, *best.values(), strict=True)
        ]
        return Answer(["batch", *best, *names, "elapsed"], rows)

    def critical(self, fixed: Mapping[str, Any]) -> Answer:
        """The critical values of each number, the other parameters being fixed.

        Raises:
            InputError: the strategy makes no failure map, or a fixed value is not in the space.
        """
        base = self.middle(fixed)
        columns = ["parameter", "critical", "low", "high", "above", "crossing", "open"]
        return Answer(columns, [astuple(item) for item in self.failure_map.critical(base)])

    def middle(self, fixed: Mapping[str, Any]) -> list[float]:
        """The place of fixed values in the unit cube, in the middle of all other dimensions.

        Raises:
            InputError: a fixed value is not in the space.
        """
        space = self.search.search_space
        for name, value in fixed.items():
            if name not in space:
                raise InputError(
                    f"`{name}` is not a dimension of the search space",
                    hint=as_hint(suggest(name, space)),
                )
            if not holds(space[name], value):
                raise InputError(
                    f"{name} = {value!r} is not in the search space.",
                    hint="choose a value in the limits of the dimension",
                )
        return [place(dim, fixed[name]) if name in fixed else 0.5 for name, dim in space.items()]

    def map(self) -> Answer:
        """The rate of failures at points all over the space, each with its 95 % interval.

        Raises:
            InputError: the strategy makes no failure map.
        """
        columns = [*self.search.search_space, "failure_rate", "low", "high"]
        return Answer(columns, list(self.failure_map.rows()))

    def archive(self) -> Answer:
        """The best set of each cell of the archive, its cell's number first.

        Raises:
            InputError: the strategy keeps no archive.
        """
        elites, strategy = self.elites, self.strategy
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
            for cell, ev in sorted(elites.items())
        ]
        return Answer(["cell", "config", *space, objective, *axes], rows)

    @property
    def elites(self) -> dict[int, Evaluation]:
        """The best set of each cell of the archive that has one.

        Raises:
            InputError: the strategy keeps no archive.
        """
        found: dict[int, Evaluation] | None = getattr(self.strategy, "elites", None)
        if found is None:
            raise InputError(
                f"the strategy `{self.search.strategy}` has no archive", hint="use `qd`"
            )
        return found

    def best(self) -> Answer:
        """The best set, or those of several objectives that no other beats in all of them."""
        configs, space = self.history.configs(), self.search.search_space
        names = [objective.name for objective in self.search.objectives]
        rows = [
            (
                configs[ev.params.id],
                *(ev.params.values[name] for name in space),
                *(ev.objectives[name] for name in names),
                ev.n_samples,
            )
            for ev in unbeaten(self.search.objectives, self.evaluated.values())
        ]
        return Answer(["config", *space, *names, "n_samples"], rows)

    @cached_property
    def failure_map(self) -> FailureMap:
        """The map of the strategy.

        Raises:
            InputError: the strategy makes no failure map.
        """
        make = getattr(self.strategy, "map", None)
        if make is None:
            raise InputError(
                f"the strategy `{self.search.strategy}` has no failure map", hint="use `boundary`"
            )
        with plugin_errors(lambda error: InputError(f"{self.document}: {error}.")):
            found: FailureMap = make()
        return found


def stored_search(campaign: Path) -> StoredSearch:
    """The search in a campaign's folder, whose document and plugins are loaded.

    Raises:
        InputError: the folder is no search, or nothing of it was scored yet.
    """
    layout = Layout(campaign)
    document = load_document(document_path(layout, read_configurations(layout)))
    stored = StoredSearch(search_of(document), SearchHistory(layout), document.path)
    if not stored.history.finished:
        raise InputError(
            f"{campaign}: no batch of the search is finished yet.",
            hint="wait until a batch has finished",
        )
    return stored
