"""What a search has stored, batch by batch; everything that decides is rebuilt from it.

```
_execution/search/batch-0003.json          what was proposed, written before any of it runs
_execution/search/batch-0003.again.json    the runs that were added, since sets had no verdict
_execution/search/batch-0003.result.json   the evaluations, written when all of it was scored
```

Files are written atomically, once, and never changed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any, ClassVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from robovast.base import safe_paths
from robovast.base.atomic import make_folder, write_atomically
from robovast.base.errors import InputError
from robovast.campaign.layout import SEARCH, Layout
from robovast.model.document.search.section import Search
from robovast.model.document.search.space import holds
from robovast.model.packs import Block
from robovast.search.strategy import SearchStrategy
from robovast.search.types import Evaluation, ParamSet

Keep = Callable[[Path, str], None]
_NAME = re.compile(r"batch-([0-9]{4,})(|\.again|\.result)\.json")
_EXACT = ConfigDict(extra="forbid", allow_inf_nan=False)
_MOST = 128 << 20
"""Largest file [byte]: of `SETS_LIMIT` sets, each with a trace or hundreds of measures."""
_RESTORE = "restore it from a copy, since it is written only once, or start a new search"


@dataclass(frozen=True)
class Proposal:
    """The sets of a batch."""

    __pydantic_config__: ClassVar[ConfigDict] = _EXACT

    asked: int
    """Number of sets that the strategy was asked for."""
    strategy: str
    version: str
    """Version of RoboVAST that proposed."""
    seed: int
    told: int
    """Number of evaluations that the proposal was made from."""
    sets: tuple[ParamSet, ...]
    configs: tuple[str, ...]
    """The configuration of each set."""
    blocks: tuple[Block, ...]
    """The runs that it adds to the campaign's plan."""
    ahead: int = 0
    """Number of batches before it whose runs were still executed when it was proposed."""


@dataclass(frozen=True)
class Scored:
    """The evaluation of a set, or why there is none."""

    __pydantic_config__: ClassVar[ConfigDict] = _EXACT

    id: str
    objectives: Mapping[str, float] = field(default_factory=dict)
    measures: Mapping[str, float] = field(default_factory=dict)
    n_samples: int = 0
    error: str = ""
    trace: str = ""
    n_runs: int = 0

    def evaluation(self, params: ParamSet, folder: Path) -> Evaluation:
        """The evaluation as strategies are told it."""
        raw = {"config_dir": str(folder)}
        numbers = dict(self.objectives), dict(self.measures), self.n_samples
        return Evaluation(params, *numbers, raw, self.n_runs)


@dataclass(frozen=True)
class BatchOutcome:
    """The end of a batch."""

    __pydantic_config__: ClassVar[ConfigDict] = _EXACT

    scores: tuple[Scored, ...]
    elapsed: float
    """Time of the search until then [s]."""
    finished_at: float
    """[s since the epoch]"""
    metrics: Mapping[str, float] = field(default_factory=dict)
    """Numbers in the strategy's report."""


@dataclass
class Batch:
    """A batch as far as it is stored."""

    number: int
    proposal: Proposal
    again: tuple[Block, ...] | None = None
    outcome: BatchOutcome | None = None

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All runs that the batch added to the plan."""
        return (*self.proposal.blocks, *(self.again or ()))

    @property
    def known(self) -> int:
        """Number of batches whose evaluations it was proposed from."""
        return self.number - self.proposal.ahead


class SearchHistory:
    """The stored batches of a search."""

    def __init__(self, layout: Layout, keep: Keep = write_atomically) -> None:
        """Read what is stored.

        Args:
            layout: of the campaign.
            keep: writes a file, with its content.
        """
        self._layout = layout
        self._keep = keep
        self._folder = layout.root / SEARCH
        self.batches = self._read()

    @property
    def blocks(self) -> list[Block]:
        """All blocks of the campaign's plan, in the order in which they were added: a batch when
        those that it was made from were scored, runs once more before their own batch was."""
        added = [(batch.known, 0, batch.number, batch.proposal.blocks) for batch in self.batches]
        added += [(batch.number, 1, 0, batch.again or ()) for batch in self.batches]
        return [block for *_, blocks in sorted(added, key=lambda a: a[:3]) for block in blocks]

    @property
    def finished(self) -> list[Batch]:
        """The batches that were scored."""
        return [batch for batch in self.batches if batch.outcome is not None]

    @property
    def open(self) -> list[Batch]:
        """The batches that are not scored yet."""
        return [batch for batch in self.batches if batch.outcome is None]

    @property
    def elapsed(self) -> float:
        """Time of the search until the end of its last batch [s]."""
        ends = [batch.outcome.elapsed for batch in self.batches if batch.outcome is not None]
        return ends[-1] if ends else 0.0

    def scores(self) -> dict[str, Scored]:
        """The last score of every set."""
        return {s.id: s for b in self.batches if b.outcome is not None for s in b.outcome.scores}

    def configs(self) -> dict[str, str]:
        """The configuration of every set, by identifier."""
        return {
            params.id: config
            for batch in self.batches
            for params, config in zip(batch.proposal.sets, batch.proposal.configs, strict=True)
        }

    def evaluations(self, batch: Batch) -> list[Evaluation]:
        """The evaluations of a batch, in the order of its sets; those without a score are missing.

        A set that stands twice is evaluated twice, with the same numbers.
        """
        scores = {score.id: score for score in batch.outcome.scores} if batch.outcome else {}
        pairs = zip(batch.proposal.sets, batch.proposal.configs, strict=True)
        return [
            scores[params.id].evaluation(params, self._layout.variant(config))
            for params, config in pairs
            if params.id in scores and not scores[params.id].error
        ]

    def replay(self, strategy: SearchStrategy) -> None:
        """Ask and tell a new strategy what was asked and told, in the same order."""
        scored, told = self.finished, 0
        for batch in self.batches:
            self._update_strategy(strategy, scored[told : batch.known])
            told = max(told, batch.known)
            strategy.repeat(batch.proposal.asked, batch.proposal.sets)
        self._update_strategy(strategy, scored[told:])

    def _update_strategy(self, strategy: SearchStrategy, batches: Sequence[Batch]) -> None:
        for batch in batches:
            strategy.tell(self.evaluations(batch))

    def check(self, search: Search) -> None:
        """Check that the stored sets and scores are those of a search.

        Raises:
            InputError: a set is not in its space, or a score lacks an objective.
        """
        space, names = search.search_space, {objective.name for objective in search.objectives}
        for batch in self.batches:
            for params in batch.proposal.sets:
                if set(params.values) != set(space) or not all(
                    holds(space[name], value) for name, value in params.values.items()
                ):
                    why = f"the set {params.id} is not in the search space"
                    raise self._error(batch.number, "", why)
            for score in batch.outcome.scores if batch.outcome else ():
                if not score.error and not names <= set(score.objectives):
                    why = f"the score of {score.id} lacks an objective"
                    raise self._error(batch.number, ".result", why)

    def propose(self, proposal: Proposal) -> Batch:
        """Store a new batch."""
        batch = Batch(len(self.batches), proposal)
        data = asdict(proposal) | {"blocks": [block.model_dump() for block in proposal.blocks]}
        self._write(batch.number, "", data)
        self.batches.append(batch)
        return batch

    def repeat(self, batch: Batch, blocks: Sequence[Block]) -> None:
        """Store the runs that are added to a batch."""
        self._write(batch.number, ".again", [block.model_dump() for block in blocks])
        batch.again = tuple(blocks)

    def finish(self, batch: Batch, outcome: BatchOutcome) -> None:
        """Store the end of a batch."""
        self._write(batch.number, ".result", asdict(outcome))
        batch.outcome = outcome

    def _write(self, number: int, part: str, data: Any) -> None:
        make_folder(self._folder)
        self._keep(self._layout.batch(number, part), json.dumps(data, indent=1) + "\n")

    def _read(self) -> list[Batch]:
        """The batches as they are at one moment: another program may store further ones."""
        found = (_NAME.fullmatch(path.name) for path in self._folder.glob("batch-*.json"))
        stored = {(int(name[1]), name[2]) for name in found if name}
        batches: list[Batch] = []
        while (number := len(batches), "") in stored:
            proposal = self._checked(number, self._load(number, "", Proposal))
            again = (number, ".again") in stored
            scored = (number, ".result") in stored
            batches.append(
                Batch(
                    number,
                    proposal,
                    self._load(number, ".again", tuple[Block, ...]) if again else None,
                    self._scores(number, proposal) if scored else None,
                )
            )
        self._refuse_gaps(stored, batches)
        return batches

    def _refuse_gaps(self, stored: Collection[tuple[int, str]], batches: Sequence[Batch]) -> None:
        """Refuse batches of which an earlier file is missing: each was made from all before it.

        Raises:
            InputError: a file is missing.
        """
        scored = len(list(takewhile(lambda batch: batch.outcome is not None, batches)))
        for number, part in sorted(stored):
            if number >= len(batches):
                missing = self._layout.batch(len(batches), "")
            elif batches[number].known > scored or (part == ".result" and number >= scored):
                missing = self._layout.batch(scored, ".result")
            else:
                continue
            there = self._layout.batch(number, part).name
            raise InputError(f"{missing}: is missing, but {there} exists", hint=_RESTORE)

    def _checked(self, number: int, proposal: Proposal) -> Proposal:
        if not 0 <= proposal.ahead <= number:
            raise self._error(number, "", f"`ahead` must be from 0 to {number}")
        if len(proposal.configs) != len(proposal.sets):
            raise self._error(number, "", "has not one name in `configs` for each of its `sets`")
        for name in proposal.configs:
            if name in {"", ".", ".."} or Path(name).name != name or "\0" in name:
                raise self._error(
                    number, "", (f"`{name}` in `configs` is not the name of a configuration")
                )
        return proposal

    def _scores(self, number: int, proposal: Proposal) -> BatchOutcome:
        outcome: BatchOutcome = self._load(number, ".result", BatchOutcome)
        if not {p.id for p in proposal.sets} <= {s.id for s in outcome.scores}:
            raise self._error(number, ".result", "`scores` lacks a set of the batch")
        return outcome

    def _load(self, number: int, part: str, kind: Any) -> Any:
        path = self._layout.batch(number, part)
        try:
            data = json.loads(safe_paths.read_file(path, most=_MOST))
            return TypeAdapter(kind).validate_python(data)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(map(str, first["loc"])) or "the file"
            raise self._error(number, part, f"`{place}`: {first['msg']}") from error
        except (OSError, ValueError, RecursionError) as error:
            raise self._error(number, part, str(error)) from error

    def _error(self, number: int, part: str, why: str) -> InputError:
        path = self._layout.batch(number, part)
        return InputError(f"{path}: cannot be used: {why}", hint=_RESTORE)
