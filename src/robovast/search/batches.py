"""The rounds of a search: propose, execute, score, until a criterion is reached.

All that decides is in the stored history: a search that was killed continues from there, with the
same sets as if it had not been.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Protocol

from robovast.base.errors import InputError
from robovast.base.plugins import plugin_errors, raised
from robovast.base.version import __version__
from robovast.campaign.layout import Layout
from robovast.model.document import Document
from robovast.model.document.search.criteria import Criterion
from robovast.model.expansion import Composition, Variant
from robovast.model.packs import RUNS_LIMIT, Block
from robovast.search.ending import Stop, best_after, ending, reached
from robovast.search.extractor import Extractor
from robovast.search.history import Batch, BatchOutcome, Proposal, SearchHistory
from robovast.search.plugins import make_strategy, search_of
from robovast.search.proposing import Expand, ask, expand_sets, with_entries
from robovast.search.scoring import samples, score
from robovast.search.strategy import SearchStrategy
from robovast.search.types import Evaluation, ParamSet, SearchReport

OPEN = 3
"""Most batches that are executed side by side, so that nothing waits for the slowest run of one."""
ENOUGH = 16
"""Runs beyond those of the oldest open batch with which a third one need not be open: they keep
eight workers busy while its slowest run, which takes five times as long as others, is awaited. The
document decides, not the machine: a search has the same sets wherever it is executed."""


class SearchObserver(Protocol):
    """Receives what there is to say."""

    def message(self, text: str) -> None:
        """Say it."""


class BatchedCampaign(Protocol):
    """A campaign whose variants and runs are added while it is executed."""

    @property
    def variants(self) -> Sequence[Variant]:
        """Those that were made, in order."""

    @property
    def layout(self) -> Layout:
        """Its folder."""

    @property
    def observer(self) -> SearchObserver:
        """Is told what there is to say."""

    @property
    def interrupted(self) -> bool:
        """Whether runs are left that are not executed now."""

    def index(self, name: str) -> int | None:
        """Position of a variant; None if it is unknown."""

    def runs_of(self, name: str) -> int:
        """Number of planned runs of a variant."""

    def add_variants(self, document: Document, composition: Composition) -> None:
        """Write the inputs of further variants; those that are known must not be among them."""

    def plan(self, blocks: Sequence[Block]) -> None:
        """Append blocks to the plan."""

    def execute(self, blocks: Sequence[Block], meanwhile: Sequence[Block]) -> None:
        """Execute the runs of blocks of the plan that are not finished.

        Those of `meanwhile` may be executed, too, but are not waited for.
        """


@dataclass
class Rounds:
    """One search, as far as it was executed."""

    document: Document
    campaign: BatchedCampaign
    history: SearchHistory
    extractor: Extractor
    process: Callable[[], None]
    """Calls the postprocessing of the search."""
    finished: Callable[[Stop | None], None]
    """Is called at each batch's end."""
    expand: Expand
    elapsed: Callable[[], float]
    """For how long the search has been under way [s]."""
    strategy: SearchStrategy = field(init=False)
    best: list[float | None] = field(default_factory=list)
    """The best value of the first objective after each batch."""

    def __post_init__(self) -> None:
        self.history.check(search_of(self.document))
        self.strategy = make_strategy(self.document)
        with self._calling("replay"):
            self.history.replay(self.strategy)
        for batch in self.history.finished:
            self._note(batch)

    def run(self) -> Stop | None:
        """Execute batches until the search ends; return why, or None if runs are left."""
        if self.history.finished:  # whoever was killed may have stored a batch, and not told it
            self.finished(None)
        while open_ := self._open_batches():
            if not self._batch(*open_):
                return None
        stop = self.stop()
        self.finished(stop)
        return stop

    def stop(self) -> Stop | None:
        """Why the search has ended; None while it has not."""
        stop = ending(search_of(self.document), self.history, self.best)
        if stop is None and self.history.finished and self._is_done():
            return Stop("strategy", "the strategy has finished")
        return stop

    def criteria(self, further: int = 0) -> list[Criterion]:
        """How far the criteria are after the last batch that was scored, or after further ones."""
        return reached(search_of(self.document), self.history, self.best, further)

    def report(self) -> SearchReport:
        """The strategy's report.

        Raises:
            InputError: the strategy raises, or returns something else.
        """
        with self._calling("report"):
            report = self.strategy.report()
        best = getattr(report, "best", None)
        if not isinstance(report, SearchReport) or not isinstance(report.extra, dict):
            raise self._error(f"`report` must return a SearchReport, not {report!r:.80}")
        if best is not None and not isinstance(best, Evaluation):
            raise self._error(f"`best` of its report must be an Evaluation, not {best!r:.80}")
        return report

    def _is_done(self) -> bool:
        with self._calling("is_done"):
            return bool(self.strategy.is_done())

    def _batch(self, batch: Batch, *later: Batch) -> bool:
        """Execute a batch, perhaps its rest; return False if runs are left."""
        meanwhile = [block for other in later for block in other.blocks]
        self.campaign.execute(batch.blocks, meanwhile)
        if not self.campaign.interrupted:
            self._execute_again(batch, meanwhile)
        if self.campaign.interrupted:
            return False
        self.process()
        self._score(batch)
        return True

    def _open_batches(self) -> list[Batch]:
        """The batches under way, with those that are due; their configurations exist.

        What is due follows from what is stored, not from what is executed first: so a search that
        was killed asks the same questions again.
        """
        for batch in self.history.open:
            self._make(batch)
        while self._is_due() and (new := self._propose()):
            self._make(new)
        return self.history.open

    def _is_due(self) -> bool:
        """Whether a batch is to be proposed now.

        One that is made from results waits for those of the first batch.
        """
        if self.stop() is not None:
            return False
        under_way = len(self.history.open)
        if not under_way:
            return True
        spent = any(c.fired for c in self.criteria(under_way))
        knows = bool(self.history.finished) or self.strategy.fills
        return knows and self.strategy.asks_ahead and not spent and _has_room(self.history.open)

    def _make(self, batch: Batch) -> None:
        """Make the configurations of a batch, as far as there are none."""
        missing = {
            params.id: params
            for params, config in zip(batch.proposal.sets, batch.proposal.configs, strict=True)
            if self.campaign.index(config) is None
        }
        if missing:
            sets = list(missing.values())
            composition, _ = expand_sets(self.document, sets, self.expand)
            self.campaign.add_variants(with_entries(self.document, sets), composition)

    def _propose(self) -> Batch | None:
        """A new batch; None if there is nothing to propose until more is known."""
        search, ahead = search_of(self.document), len(self.history.open)
        sets = ask(self.document, self.strategy)
        if ahead and not sets:
            return None
        known = self.history.configs()
        new = {params.id: params for params in sets if params.id not in known}
        names = dict(known)
        if new:
            names |= expand_sets(self.document, list(new.values()), self.expand)[1]
        blocks = self._blocks(sets, names)
        told = sum(len(self.history.evaluations(batch)) for batch in self.history.finished)
        proposal = Proposal(
            asked=search.per_batch,
            strategy=search.strategy,
            version=__version__,
            seed=search.seed,
            told=told,
            sets=tuple(sets),
            configs=tuple(names[params.id] for params in sets),
            blocks=tuple(blocks),
            ahead=ahead,
        )
        batch = self.history.propose(proposal)
        self.campaign.plan(blocks)
        return batch

    def _blocks(self, sets: list[ParamSet], names: dict[str, str]) -> list[Block]:
        """The runs that sets need beyond those that are planned; equal sets are run once.

        A set that is executed now gets no further ones: its score does not depend on who is faster.

        Raises:
            InputError: they are too many.
        """
        usual = self.document.vast.execution.most_runs
        executed = {params.id for batch in self.history.open for params in batch.proposal.sets}
        wanted: dict[str, int] = {}
        for params in sets:
            if params.id in executed:
                continue
            asked = params.n_reps or usual
            wanted[params.id] = max(asked, wanted.get(params.id, 0))
        blocks: list[Block] = []
        following = len(self.campaign.variants)
        for id_, runs in wanted.items():
            index = self.campaign.index(names[id_])
            have = self.campaign.runs_of(names[id_])
            if index is None:
                index, following = following, following + 1
            if runs > have:
                added = Block(first_variant=index, variants=1, first_run=have, runs=runs - have)
                _append(blocks, added)
        total = sum(block.size for block in (*self.history.blocks, *blocks))
        if total > RUNS_LIMIT:
            raise self._error(
                f"with its sets the campaign has {total:,} runs, more than {RUNS_LIMIT:,}"
            )
        return blocks

    def _execute_again(self, batch: Batch, meanwhile: Sequence[Block]) -> None:
        """Execute more runs, once, of sets of which no run came to a verdict."""
        if batch.again is None:
            blocks = [
                Block(
                    first_variant=self.campaign.index(config) or 0,
                    variants=1,
                    first_run=self.campaign.runs_of(config),
                    runs=self.document.vast.execution.most_runs,
                )
                for config in dict.fromkeys(batch.proposal.configs)
                if self._is_new(batch, config) and not samples(self._layout, config)
            ]
            if not blocks:
                return
            self.campaign.observer.message(
                f"{len(blocks)} of {len(batch.proposal.sets)} sets have no verdict; they are run "
                "again."
            )
            self.history.repeat(batch, blocks)
            self.campaign.plan(blocks)
        self.campaign.execute(batch.again or (), meanwhile)

    def _is_new(self, batch: Batch, config: str) -> bool:
        """Whether the batch itself runs a configuration."""
        index = self.campaign.index(config)
        return any(
            block.first_variant <= (index or 0) < block.first_variant + block.variants
            for block in batch.proposal.blocks
        )

    @property
    def _layout(self) -> Layout:
        return self.campaign.layout

    def _score(self, batch: Batch) -> None:
        """Score a batch, tell the strategy, store the end of the batch."""
        search = search_of(self.document)
        configs = {
            params.id: config
            for params, config in zip(batch.proposal.sets, batch.proposal.configs, strict=True)
        }
        known = self.history.scores()
        new = {i: c for i, c in configs.items() if i not in known or self._is_new(batch, c)}
        needed = self.strategy.needed_measures
        fresh = {
            s.id: replace(s, n_runs=self.campaign.runs_of(new[s.id]))
            for s in score(search, self.extractor, self._layout, new, needed)
        }
        scores = tuple(fresh.get(id_) or known[id_] for id_ in configs)
        for scored in fresh.values():
            if scored.error:
                self.campaign.observer.message(f"{configs[scored.id]} is skipped: {scored.error}")
        provisional = BatchOutcome(scores, 0.0, 0.0)
        batch.outcome = provisional
        with self._calling("tell"):
            self.strategy.tell(self.history.evaluations(batch))
        self._note(batch)
        metrics = {k: float(v) for k, v in self.report().extra.items() if _is_number(v)}
        elapsed = round(self.elapsed(), 3)
        self.history.finish(batch, BatchOutcome(scores, elapsed, time.time(), metrics))
        self.finished(None)
        self.campaign.observer.message(self._line(batch))

    def _line(self, batch: Batch) -> str:
        """`batch 2 is scored: batches 3/50 | failure_rate 0.97/0.9 | best failure_rate 0.97`."""
        parts = [str(criterion) for criterion in self.criteria()]
        best = [f"best {self.best_value}"] if self.best_value else []
        return f"batch {batch.number} is scored: {' | '.join([*parts, *best])}"

    @property
    def best_value(self) -> str:
        """`failure_rate 0.97`; empty as long as no set has a score."""
        best = self.best[-1] if self.best else None
        name = search_of(self.document).objectives[0].name
        return "" if best is None else f"{name} {best:.6g}"

    def _note(self, batch: Batch) -> None:
        """Keep the best value after a batch."""
        before = self.best[-1] if self.best else None
        objective = search_of(self.document).objectives[0]
        self.best.append(best_after(objective, self.history.evaluations(batch), before))

    def _calling(self, method: str) -> AbstractContextManager[None]:
        """Wrap a call of the strategy: what it raises is its error."""
        return plugin_errors(lambda error: self._error(f"`{method}` raised {raised(error)}"))

    def _error(self, message: str) -> InputError:
        name = search_of(self.document).strategy
        return InputError(f"{self.document.path}: the strategy `{name}`: {message}.")


def _has_room(open_: Sequence[Batch]) -> bool:
    """Whether another batch is to be executed beside those under way."""
    waiting = sum(block.size for batch in open_[1:] for block in batch.proposal.blocks)
    return len(open_) < OPEN and waiting < ENOUGH


def _append(blocks: list[Block], added: Block) -> None:
    """Append a block, or extend the last one where its variants follow with equal runs."""
    if blocks:
        last = blocks[-1]
        follows = last.first_variant + last.variants == added.first_variant
        if follows and (last.first_run, last.runs) == (added.first_run, added.runs):
            blocks[-1] = last.model_copy(update={"variants": last.variants + 1})
            return
    blocks.append(added)


def _is_number(value: object) -> bool:
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an int that is too large for a float
        return False
