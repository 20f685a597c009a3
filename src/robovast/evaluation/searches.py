"""What the page shows of searches: maps, archives, the best sets, and how they came to be.

Of strategies only those of RoboVAST are made: a stored file may be anybody's code.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from robovast.base.errors import InputError
from robovast.campaign.layout import EXECUTION_RECORD, SEARCH, Layout
from robovast.evaluation.campaign_inputs import read_document
from robovast.evaluation.confined_files import resolved
from robovast.evaluation.launch.commands import continue_words
from robovast.evaluation.library import Library
from robovast.evaluation.summaries import CampaignSummary
from robovast.evaluation.untrusted_data import read_yaml
from robovast.model.document.search.plugins import BUILT_IN, STRATEGIES
from robovast.model.document.search.section import Search
from robovast.model.document.search.space import at, place, ticks
from robovast.model.naming import CONFIG
from robovast.search.ending import best_values, ending, reached, until_batches
from robovast.search.history import SearchHistory
from robovast.search.results import StoredSearch
from robovast.search.strategy import unbeaten
from robovast.search.types import Evaluation

if TYPE_CHECKING:
    from robovast.search.strategies.archives import ArchiveParameters, Measure

PAUSE = 20
"""Minimum time between readings of a search under way, as a multiple of one."""
_MOST_BINS = 100
"""Cells of an archive's axis that are drawn."""
_MOST_LEFT_OUT = 100
"""Sets without a score that are listed."""


@dataclass  # not frozen: what was computed is kept
class ShownSearch:
    """A search as it was stored at some moment."""

    stored: StoredSearch

    @property
    def _search(self) -> Search:
        return self.stored.search

    @cached_property
    def built_in(self) -> bool:
        """Whether the strategy is one of RoboVAST."""
        return self._search.strategy in BUILT_IN[STRATEGIES]

    @cached_property
    def overview(self) -> dict[str, Any]:
        """The part that is the same for every selection."""
        search, history = self._search, self.stored.history
        best = best_values(search.objectives[0], history)
        stop = ending(search, history, best)
        report = self.stored.report()
        errors = {id_: s.error for id_, s in history.scores().items() if s.error}
        configs = history.configs()
        return {
            "batches": len(history.finished),
            "strategy": search.strategy,
            "built_in": self.built_in,
            "seed": search.seed,
            "objectives": [objective.model_dump() for objective in search.objectives],
            "dimensions": [
                {"name": name, "type": dim.type, "ticks": ticks(dim), "middle": at(dim, 0.5)}
                for name, dim in search.search_space.items()
            ],
            "measures": self.measures,
            "shown": self.shown,
            "evaluated": len(self.stored.evaluated),
            "left_out": len(errors),
            "errors": [[configs[id_], e] for id_, e in [*errors.items()][:_MOST_LEFT_OUT]],
            "criteria": reached(search, history, best),
            "ended": stop,
            "report": {n: [row[i] for row in report.rows] for i, n in enumerate(report.columns)},
            "proposed": [
                (len(b.proposal.sets), b.proposal.told, b.proposal.version, b.proposal.strategy)
                for b in history.batches
            ],
        }

    @property
    def shown(self) -> str:
        """What the strategy makes: `map`, `archive`, or nothing of its own."""
        own = {"boundary": "map", "qd": "archive"}.get(self._search.strategy, "")
        return own if self.built_in and self.stored.history.finished else ""

    @cached_property
    def measures(self) -> list[str]:
        """Names of the measured numbers of all sets; of an archive, its axes first."""
        found = dict.fromkeys(name for ev in self._known for name in ev.measures)
        return list(dict.fromkeys([*self._axes, *found]))

    @cached_property
    def _archive(self) -> ArchiveParameters | None:
        """The archive, if the strategy keeps one."""
        if self.shown != "archive":
            return None
        found: ArchiveParameters = self.stored.strategy.params.archive
        return found

    @property
    def _axes(self) -> Mapping[str, Measure]:
        """The axes of the archive, by name; none where there is none."""
        return self._archive.measures if self._archive else {}

    @property
    def _known(self) -> Iterable[Evaluation]:
        return self.stored.evaluated.values()

    @cached_property
    def _best(self) -> set[str]:
        """Sets that nothing beats; of an archive, the best of each cell."""
        if self.shown == "archive":
            return {ev.params.id for ev in self.stored.elites.values()}
        return {ev.params.id for ev in unbeaten(self._search.objectives, self._known)}

    def sets(self, across: str, down: str) -> dict[str, Any]:
        """All evaluated sets at their places over two axes.

        Raises:
            InputError: there is no such axis.
        """
        known = list(self._known)
        configs, objective = self.stored.history.configs(), self._search.objectives[0].name
        batches = {
            params.id: batch.number
            for batch in reversed(self.stored.history.batches)
            for params in batch.proposal.sets
        }
        return {
            "x": self._axis(across),
            "y": self._axis(down),
            "config": [configs[ev.params.id] for ev in known],
            "value": [ev.objectives[objective] for ev in known],
            "runs": [ev.n_samples for ev in known],
            "batch": [batches[ev.params.id] for ev in known],
            "best": [i for i, ev in enumerate(known) if ev.params.id in self._best],
        }

    def _axis(self, name: str) -> dict[str, Any]:
        """Places of all sets along an axis, from 0 to 1, and the texts beside it."""
        space = self._search.search_space
        if name in space:
            spots = [place(space[name], ev.params.values[name]) for ev in self._known]
            return {"name": name, "ticks": ticks(space[name]), "places": _rounded(spots), "bins": 0}
        values = [ev.objectives.get(name, ev.measures.get(name)) for ev in self._known]
        numbers = [value for value in values if value is not None]
        if not numbers:
            raise InputError(f"`{name}` is not a parameter or a number of the search.")
        axis = self._axes.get(name)
        low, high = (axis.low, axis.high) if axis else (min(numbers), max(numbers))
        length = min(high - low, sys.float_info.max) or 1.0
        spots = [-1.0 if v is None else min(max((v - low) / length, 0.0), 1.0) for v in values]
        few = axis and self._archive and self._archive.type == "grid" and axis.bins <= _MOST_BINS
        return {
            "name": name,
            "ticks": [(i / 5, f"{low + length * (i / 5):.3g}") for i in range(6)],
            "places": _rounded(spots),
            "bins": axis.bins if axis and few else 0,
        }

    def map(self, across: str, down: str, units: Mapping[str, float]) -> dict[str, Any]:
        """The failure map over two dimensions, in thousandths, row by row from the lowest.

        Args:
            across: one dimension.
            down: another one.
            units: places of others in the unit interval; their middle where they are not given.

        Raises:
            InputError: there is no such map or dimension.
        """
        self._demand_map()
        space = self._search.search_space
        if across == down or not {across, down} <= set(space):
            raise InputError(
                "A map needs two different parameters of the search.",
                hint="choose two different parameters",
            )
        found = self.stored.failure_map
        values = {name: at(dim, units.get(name, 0.5)) for name, dim in space.items()}
        base = [place(dim, values[name]) for name, dim in space.items()]
        surface = found.over(across, down, base)
        return {
            "width": len(surface.across),
            "height": len(surface.down),
            "x": _rounded(surface.across),
            "y": _rounded(surface.down),
            "level": found.level,
            **{
                name: [round(1000 * float(rate)) for row in rates for rate in row]
                for name, rates in (
                    ("rate", surface.rate),
                    ("low", surface.low),
                    ("high", surface.high),
                )
            },
            "critical": [
                {**asdict(one), "crossing": round(one.crossing, 3)} for one in found.critical(base)
            ],
            "values": values,
        }

    def _demand_map(self) -> None:
        if self.shown != "map":
            raise InputError(f"The strategy `{self._search.strategy}` provides no failure map.")


def _rounded(spots: Iterable[float]) -> list[float]:
    return [round(spot, 4) for spot in spots]


@dataclass(frozen=True)
class _Known:
    changed: tuple[int, ...]
    """Modification times of the files that it was read from [ns]."""
    found: ShownSearch
    until: float
    """How long it is good enough while the search is executed [s, monotonic]."""


def go_on_words(results: Path, summary: CampaignSummary) -> list[str]:
    """Arguments that let a search go on, half as many batches further where it has ended; empty
    while it is executed, and where `continue_words` are.

    Raises:
        InputError: it cannot be read.
    """
    words = continue_words(results, summary)
    if not words or summary.state == "running":
        return []
    stored = _read(results.resolve(), summary.name)
    search, history = stored.search, stored.history
    if ending(search, history, best_values(search.objectives[0], history)) is None:
        return words
    done = len(history.finished)
    return [*words, f"--batches={done + max(1, math.ceil(done / 2))}"]


class Searches:
    """Searches of a library; what was read is kept until more is stored. Thread-safe."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._known: dict[str, _Known] = {}
        self._lock = Lock()

    def of(self, name: str) -> ShownSearch:
        """The search of a campaign.

        Raises:
            InputError: there is no such campaign, or it is no search, or cannot be read.
        """
        running = self._library.summary(name).state == "running"
        results = self._library.results
        resolved(results, f"{name}/{SEARCH}")
        with self._lock:  # a second request waits for the first instead of reading the same
            known = self._known.get(name)
            changed = _changed(results / name)
            if known and (known.changed == changed or (running and time.monotonic() < known.until)):
                return known.found
            begin = time.monotonic()
            found = ShownSearch(_read(results, name))
            now = time.monotonic()
            self._known = {name: _Known(changed, found, now + PAUSE * (now - begin))}
            return found


def _changed(campaign: Path) -> tuple[int, ...]:
    """A folder changes whenever a file in it is written atomically."""
    return tuple(_stamp(campaign / path) for path in (SEARCH, EXECUTION_RECORD))


def _stamp(path: Path) -> int:
    """When a file or folder was changed [ns]; 0 if it is missing."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _read(results: Path, name: str) -> StoredSearch:
    """The search as it is stored, with the budget that it was continued with.

    Raises:
        InputError: it cannot be read.
    """
    file, data = read_document(results, name)
    batches = read_yaml(results, f"{name}/{EXECUTION_RECORD}").get("batches")
    try:
        search = Search.model_validate(data.get("search"))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, ("search", *first["loc"])))
        raise InputError(f"{name}/{CONFIG}/{file}: `{place}`: {first['msg']}.") from None
    search = until_batches(search, batches if type(batches) is int else None)
    return StoredSearch(
        search, SearchHistory(Layout(results / name)), results / name / CONFIG / file
    )
