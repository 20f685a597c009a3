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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

from robovast.base.atomic import make_folder, write_atomically
from robovast.base.errors import InputError
from robovast.campaign.layout import Layout
from robovast.model.naming import EXECUTION
from robovast.model.packs import Block
from robovast.search.types import Evaluation, ParamSet

FOLDER = f"{EXECUTION}/search"


@dataclass(frozen=True)
class Proposal:
    """The sets of a batch."""

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


@dataclass(frozen=True)
class Scored:
    """The evaluation of a set, or why there is none."""

    id: str
    objectives: Mapping[str, float] = field(default_factory=dict)
    measures: Mapping[str, float] = field(default_factory=dict)
    n_samples: int = 0
    error: str = ""
    trace: str = ""

    def evaluation(self, params: ParamSet, folder: Path) -> Evaluation:
        """The evaluation as strategies are told it."""
        raw = {"config_dir": str(folder)}
        return Evaluation(params, dict(self.objectives), dict(self.measures), self.n_samples, raw)


@dataclass(frozen=True)
class Outcome:
    """The end of a batch."""

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
    outcome: Outcome | None = None

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All runs that the batch added to the plan."""
        return (*self.proposal.blocks, *(self.again or ()))


class History:
    """The stored batches of a search."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._folder = layout.root / FOLDER
        self.batches: list[Batch] = list(self._read())

    @property
    def blocks(self) -> list[Block]:
        """All blocks of the campaign's plan, in order."""
        return [block for batch in self.batches for block in batch.blocks]

    @property
    def finished(self) -> list[Batch]:
        """The batches that were scored."""
        return [batch for batch in self.batches if batch.outcome is not None]

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

    def finish(self, batch: Batch, outcome: Outcome) -> None:
        """Store the end of a batch."""
        self._write(batch.number, ".result", asdict(outcome))
        batch.outcome = outcome

    def _path(self, number: int, part: str) -> Path:
        return self._folder / f"batch-{number:04d}{part}.json"

    def _write(self, number: int, part: str, data: Any) -> None:
        make_folder(self._folder)
        write_atomically(self._path(number, part), json.dumps(data, indent=1) + "\n")

    def _read(self) -> Iterator[Batch]:
        for number in count():
            data = self._load(number, "")
            if data is None:
                return
            batch = Batch(number, _proposal(data))
            again, outcome = self._load(number, ".again"), self._load(number, ".result")
            if again is not None:
                batch.again = _blocks(again)
            if outcome is not None:
                scores = tuple(Scored(**score) for score in outcome.pop("scores"))
                batch.outcome = Outcome(scores, **outcome)
            yield batch

    def _load(self, number: int, part: str) -> Any:
        path = self._path(number, part)
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read: {error}. Restore it from a copy.") from error


def _proposal(data: dict[str, Any]) -> Proposal:
    sets = tuple(ParamSet(**params) for params in data.pop("sets"))
    blocks = _blocks(data.pop("blocks"))
    return Proposal(sets=sets, blocks=blocks, configs=tuple(data.pop("configs")), **data)


def _blocks(data: Sequence[Mapping[str, Any]]) -> tuple[Block, ...]:
    return tuple(Block.model_validate(block) for block in data)
