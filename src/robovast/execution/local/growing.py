"""A campaign whose variants and runs are added while it is executed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from robovast.campaign.configurations import read_variants
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import RunRecord
from robovast.execution.generate import write_configurations
from robovast.execution.local.campaign import execute_runs, how, stored_runs, write_job_links
from robovast.execution.local.events import Observer
from robovast.execution.local.session import Session
from robovast.execution.local.store import explained
from robovast.model.document import Document
from robovast.model.expansion import Composition
from robovast.model.growing import GrowingPlan
from robovast.model.packs import Block, PlanSpec, format_breaks
from robovast.model.plan import Run, block_runs, breaks


@dataclass
class GrowingCampaign(GrowingPlan):
    """A campaign under way, within `executing`."""

    session: Session
    observer: Observer
    seed: int | None
    """The campaign's."""
    records: dict[int, RunRecord] = field(default_factory=dict)
    """Records of finished runs, by id."""
    interrupted: bool = False

    def open(self, blocks: Sequence[Block]) -> None:
        """Read what is stored; `blocks` are the plan so far."""
        _, self.variants = read_variants(self.session.layout)
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
        with explained(layout.root):
            write_configurations(
                document, composition, layout.root, timings=True, earlier=self.variants
            )
        _, self.variants = read_variants(layout)

    def execute(self, blocks: Sequence[Block]) -> None:
        """Execute the runs of blocks of the plan that are not finished."""
        plan = self._plan()
        self.records, self.interrupted = execute_runs(
            self.session, plan, self._runs(plan, blocks), self.records, self.observer
        )
        write_job_links(self.session.layout, self.records)

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
            runs_per_job=self.session.document.vast.execution.runs_per_job,
            breaks=format_breaks(breaks(self.variants)),
        )

    def _runs(self, plan: PlanSpec, blocks: Sequence[Block]) -> list[Run]:
        return [run for b in blocks for run in block_runs(plan, b, self.variants, self.seed)]
