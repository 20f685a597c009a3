"""A campaign whose variants and runs are added while it is executed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from robovast.campaign.configurations import read_variants
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import RunRecord
from robovast.execution.generate import write_configurations
from robovast.execution.local.campaign import (
    CampaignExecution,
    how,
    stored_runs,
    write_job_links,
)
from robovast.execution.local.events import ExecutionObserver
from robovast.execution.local.pack_queue import GrowingQueue
from robovast.execution.local.reuse import reused_runs
from robovast.execution.local.session import Session
from robovast.execution.local.store import first_free_job, storage_errors
from robovast.model.document import Document
from robovast.model.expansion import Composition
from robovast.model.growing import GrowingPlan
from robovast.model.packs import Block, PlanSpec, format_breaks
from robovast.model.plan import Run, block_runs, breaks


@dataclass
class GrowingCampaign(GrowingPlan):
    """A campaign under way, within `executing`."""

    session: Session
    observer: ExecutionObserver
    seed: int | None
    """The campaign's."""
    records: dict[int, RunRecord] = field(default_factory=dict)
    """Records of finished runs, by id."""
    interrupted: bool = False
    _execution: CampaignExecution = field(init=False)
    _queue: GrowingQueue = field(init=False)
    _queued: set[int] = field(init=False, default_factory=set)
    """Ids of runs that were given to the workers."""

    def open(self, blocks: Sequence[Block]) -> None:
        """Read what is stored; `blocks` are the plan so far."""
        self.variants = read_variants(self.session.layout)
        known = len(self.variants)
        self.blocks = list(blocks)
        stored = [b for b in blocks if b.first_variant + b.variants <= known]
        runs = self._runs(self._plan(), stored)
        self.records = stored_runs(self.session, runs, self.observer)
        if blocks:
            self._announce()

    @property
    def layout(self) -> Layout:
        """The campaign's folder."""
        return self.session.layout

    def add_variants(self, document: Document, composition: Composition) -> None:
        """Write the inputs of further variants; those that are known must not be among them."""
        layout = self.session.layout
        with storage_errors(layout.root):
            write_configurations(
                document,
                composition,
                layout.root,
                timings=True,
                earlier=self.variants,
                lasting=True,
            )
        self.variants = read_variants(layout)

    @contextmanager
    def working(self) -> Iterator[None]:
        """Have workers; in the end they stop, whatever is left."""
        self._queue = GrowingQueue(self._plan(), first_free_job(self.session.layout))
        self._execution = CampaignExecution(self.session, self._queue, self.observer, self.records)
        self.records = self._execution.records
        self._execution.begin(self.session.jobs_side_by_side)
        try:
            yield
        finally:
            self._end()

    def _end(self) -> None:
        self._execution.stop()
        self._queue.close()
        self._execution.wait()
        write_job_links(self.session.layout, self.records)

    def execute(self, blocks: Sequence[Block], meanwhile: Sequence[Block]) -> None:
        """Execute the runs of blocks of the plan that are not finished.

        Those of `meanwhile` are begun after them, and are not waited for.
        """
        plan = self._plan()
        needed = self._runs(plan, blocks)
        self._begin(plan, [*needed, *self._runs(plan, meanwhile)])
        ids = {run.id for run in needed}
        self._execution.wait(lambda: self._execution.is_stopping or ids <= self.records.keys())
        if self._execution.is_stopping:
            self._end()
        self.interrupted = self._execution.interrupted
        write_job_links(self.session.layout, self.records)

    def _begin(self, plan: PlanSpec, runs: Sequence[Run]) -> None:
        """Give runs to the workers that were not given to them."""
        new = [run for run in runs if run.id not in self.records and run.id not in self._queued]
        first = self._queue.reserve(len(new) if self.session.options.reuse else 0)
        reused = reused_runs(self.session, plan, new, first, self.observer)
        self.records.update(reused)
        todo = [run for run in new if run.id not in reused]
        self._queued.update(run.id for run in todo)
        self._queue.add(plan, todo)

    def plan(self, blocks: Sequence[Block]) -> None:
        """Append blocks to the plan."""
        is_first = not self.blocks
        self.blocks += blocks
        if is_first:
            self._announce()
        else:
            self.observer.runs_added(sum(block.size for block in blocks))

    def _announce(self) -> None:
        session = self.session
        runtime = how(session, session.jobs_side_by_side)
        self.observer.campaign_started(session.layout.root, self.total, len(self.records), runtime)

    def _plan(self) -> PlanSpec:
        return PlanSpec(
            blocks=tuple(self.blocks),
            runs_per_job=self.session.document.vast.execution.runs_per_start,
            breaks=format_breaks(breaks(self.variants)),
        )

    def _runs(self, plan: PlanSpec, blocks: Sequence[Block]) -> list[Run]:
        return [run for b in blocks for run in block_runs(plan, b, self.variants, self.seed)]
