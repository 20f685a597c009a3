"""`propose`: scores what a search has run, and stores what it runs next.

What decides is in the bucket. The pod of the next batch finds it there, and so does one that takes
the place of this one: it says the same.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import mkdtemp

from robovast.agent.bucket import Bucket
from robovast.agent.campaign import PodCampaign, download, load_inputs, open_campaign
from robovast.agent.compose import files_below, store_inputs
from robovast.agent.composed import ComposedVariants, store_grown
from robovast.agent.deadline import deadline
from robovast.agent.digests import check_files
from robovast.agent.mounts import Folders
from robovast.agent.process import add_to_run
from robovast.agent.untrusted_files import SIDE_BY_SIDE
from robovast.analysis.postprocessing.content import changed, scan
from robovast.base.atomic import write_atomically
from robovast.base.errors import InputError, StorageError
from robovast.campaign.configurations import read_variants
from robovast.campaign.layout import CONFIGURATIONS, SEARCH, Layout
from robovast.campaign.object_keys import run_of
from robovast.campaign.run_files import escaped
from robovast.execution.generate import write_configurations
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.pod_contract.messages import (
    BLOCKS_LIMIT,
    BREAKS_LIMIT,
    TEXT_LIMIT,
    Proposed,
    shortened,
    write_error,
)
from robovast.model.document import Document
from robovast.model.expansion import Composition, Variant, compose
from robovast.model.expansion.containers import refuse_containers
from robovast.model.growing import GrowingPlan
from robovast.model.naming import CAMPAIGN_STORE, CONFIG
from robovast.model.packs import Block, format_breaks
from robovast.model.plan import breaks
from robovast.search.batches import Rounds
from robovast.search.ending import Stop
from robovast.search.history import SearchHistory
from robovast.search.plugins import make_extractor
from robovast.search.processing import call_postprocessing
from robovast.search.proposing import with_runs
from robovast.search.store import write_search_store
from robovast.storage.bucket_ownership import owner_of
from robovast.storage.download import Silent, download_campaign
from robovast.storage.folder_ownership import occupy

LONGEST = 2 * 3600.0
"""How long proposing may take [s]; what takes longer hangs."""


def propose(folders: Folders) -> AgentExit:
    """Go on with a search until it needs runs, or ends; say which.

    Raises:
        InputError: the document or its files are wrong, or a plugin fails.
        StorageError: the bucket cannot be read or written, or another pod was faster.
    """
    campaign = open_campaign(folders, connections=SIDE_BY_SIDE)
    campaign.bucket.claim()
    with deadline(LONGEST, partial(_report_hanging, folders)):
        _go_on(campaign).write(folders.message)
    return AgentExit.PASSED


def _report_hanging(folders: Folders, where: str) -> None:
    """Say that something takes too long."""
    text = (
        f"the proposal is not complete after {LONGEST / 3600:g} h: it is in {where}. Speed up the "
        "strategy, the extractor or the postprocessing, and create another Campaign."
    )
    print(f"error: {text}", file=sys.stderr)  # noqa: T201
    write_error(folders.message, text, as_json=True)


def _go_on(campaign: PodCampaign) -> Proposed:
    """Go on with a search until it needs runs, or ends."""
    document = with_runs(load_inputs(campaign), campaign.plan.runs)
    grown = _open(campaign, document)
    history = SearchHistory(grown.layout, partial(_keep, campaign.bucket, grown.layout))
    grown.begin(history.blocks)
    rounds = Rounds(
        document=document,
        campaign=grown,
        history=history,
        extractor=make_extractor(document),
        process=partial(_process, campaign, document, grown.layout),
        finished=lambda stop: write_search_store(grown.layout, document, history, stop),
        expand=partial(_expand, campaign),
        elapsed=partial(_elapsed, campaign, history),
    )
    stop = rounds.run()
    store = grown.layout.root / CAMPAIGN_STORE
    if store.exists():
        campaign.bucket.store.put_file(campaign.bucket.name, CAMPAIGN_STORE, store)
    return _words(rounds, grown, stop)


class _Log:
    """Writes what there is to say to the pod's log."""

    def message(self, text: str) -> None:
        """Say it."""
        print(text)  # noqa: T201


@dataclass
class ProposedCampaign(GrowingPlan):
    """A search's campaign in the cluster: what is executed stands in the mounted plan."""

    campaign: PodCampaign
    layout: Layout
    planned: Sequence[Block]
    """The blocks of the mounted plan."""
    ended: Sequence[Block]
    """Those of them whose runs have ended, as the plan says: no other run is looked at, so that
    what follows does not depend on how fast runs are."""
    made: ComposedVariants | None
    """The variants of the mounted plan."""
    digest: str = ""
    """`CampaignPlan.composed` of all variants."""
    inputs: dict[str, str] = field(default_factory=dict)
    """SHA-256 of the files beside the document, by path."""
    interrupted: bool = False
    observer: _Log = field(default_factory=_Log)

    @property
    def known(self) -> int:
        """How many variants the mounted plan has."""
        return len(self.made) if self.made is not None else 0

    def begin(self, blocks: Sequence[Block]) -> None:
        """Take over the blocks of the stored batches.

        Raises:
            InputError: they are not those of the mounted plan.
        """
        if list(blocks[: len(self.planned)]) != list(self.planned):
            raise InputError(
                f"{self.campaign.plan.bucket}/{SEARCH}: its batches are not those that the runs "
                "were planned with. They are written once and never changed",
                hint="restore them from a copy, or create another Campaign",
            )
        self.blocks = list(blocks)

    def add_variants(self, document: Document, composition: Composition) -> None:
        """Store the inputs of further variants; those of the batch before may be among the new."""
        bucket, name = self.campaign.bucket, document.path.name
        stored = store_inputs(self.campaign, document, composition, self.variants)
        plugins = files_below(self.layout.config)
        for path in plugins:
            key = escaped(f"{CONFIG}/{path}")
            bucket.store.put_file(bucket.name, key, self.layout.config / path)
        self.inputs |= plugins | files_below(stored.config)
        self.variants = [*self.variants, *composition.variants]
        new = self.variants[self.known :]
        self.digest = store_grown(bucket, name, self.inputs, self.made, new)
        shutil.copyfile(stored.configurations, self.layout.configurations)

    def plan(self, blocks: Sequence[Block]) -> None:
        """Append blocks to the plan."""
        self.blocks += blocks

    def execute(self, blocks: Sequence[Block], meanwhile: Sequence[Block]) -> None:
        """Fetch the runs of blocks that have ended; others are left to the cluster."""
        del meanwhile
        if not set(blocks) <= set(self.ended):
            self.interrupted = True
            return
        wanted = {i for b in blocks for i in range(b.first_variant, b.first_variant + b.variants)}
        below = [f"{self.variants[index].name}/" for index in sorted(wanted)]
        plan, root = self.campaign.plan, self.layout.root
        download_campaign(self.campaign.store, plan.bucket, root, Silent(), below=below)


def _open(campaign: PodCampaign, document: Document) -> ProposedCampaign:
    """The campaign with its variants and its history, as far as the bucket has them.

    Raises:
        InputError: an input is not the one that the runs were planned with.
    """
    plan, layout = campaign.plan, Layout(campaign.folders.work / "results" / campaign.plan.campaign)
    shutil.rmtree(layout.root, ignore_errors=True)
    occupy(layout.root, owner_of(campaign.store, plan.bucket))
    download(campaign, f"{SEARCH}/", layout.root)
    made, variants = None, []
    if plan.composed is not None:
        made = ComposedVariants(campaign.bucket, layout, plan.composed, growing=True)
        check_files(made.inputs, document.folder)
        variants = _with_timings(campaign, layout, list(made))
    write_configurations(document, Composition(()), layout.root, timings=True, earlier=variants)
    planned = plan.plan.blocks if plan.plan is not None else ()
    ended = plan.plan.awaited_blocks if plan.plan is not None else ()
    return ProposedCampaign(
        campaign,
        layout,
        planned,
        ended,
        made,
        digest=plan.composed or "",
        inputs=dict(made.inputs) if made is not None else {},
        variants=variants,
    )


def _with_timings(campaign: PodCampaign, layout: Layout, planned: list[Variant]) -> list[Variant]:
    """The planned variants with the times at which they were made, as far as these are stored."""
    download(campaign, CONFIGURATIONS, layout.root)
    stored = {variant.name: variant for variant in read_variants(layout)}
    return [stored.get(variant.name, variant) for variant in planned]


def _keep(bucket: Bucket, layout: Layout, path: Path, text: str) -> None:
    """Store a file of the history, which is written once.

    Raises:
        StorageError: another pod has stored another one.
    """
    key = path.relative_to(layout.root).as_posix()
    if not bucket.store.create(bucket.name, key, text.encode()):
        raise StorageError(
            f"{bucket.name}/{key}: another pod stored this object first. The next pod reads it."
        )
    write_atomically(path, text)


def _expand(campaign: PodCampaign, document: Document) -> Composition:
    """The variants of a batch; their files stay, since another batch may follow."""
    campaign.folders.scratch.mkdir(parents=True, exist_ok=True)
    scratch = Path(mkdtemp(dir=campaign.folders.scratch))
    return compose(document, scratch, print, refuse_containers)


def _elapsed(campaign: PodCampaign, history: SearchHistory) -> float:
    """Time since the first batch was proposed, by the clock of the S3 server."""
    bucket = campaign.bucket
    begun = bucket.store.look(bucket.name, f"{SEARCH}/batch-0000.json")
    return max(history.elapsed, time.time() - begun.modified if begun else 0.0)


def _process(campaign: PodCampaign, document: Document, layout: Layout) -> None:
    """Call the search's postprocessing, and store what it makes of runs beside them."""
    before = scan(layout.root, ())
    call_postprocessing(document, layout.root, print)
    made: dict[str, list[str]] = {}
    for path in changed(before, scan(layout.root, ())):
        if run_of(path):
            made.setdefault(run_of(path), []).append(path)
    for run, paths in made.items():
        add_to_run(campaign.bucket, layout.root, run, paths)


def _words(rounds: Rounds, grown: ProposedCampaign, stop: Stop | None) -> Proposed:
    """What the operator is told: runs to append, or why the search has ended."""
    new = grown.variants[grown.known :]
    cuts = format_breaks([0, *breaks(new)] if grown.known and new else breaks(new))
    if len(cuts) > BREAKS_LIMIT:
        cuts = format_breaks(range(0 if grown.known else 1, len(new)))
    known = len(grown.planned)
    left = grown.blocks[known:][:BLOCKS_LIMIT]
    scores = rounds.history.scores().values()
    criteria = " | ".join(str(criterion) for criterion in rounds.criteria())
    return Proposed(
        blocks=tuple((b.first_variant, b.variants, b.first_run, b.runs) for b in left),
        variants=len(new),
        breaks=cuts,
        digest=grown.digest,
        awaited=_awaited(rounds.history, grown, known + len(left)),
        batch=len(rounds.history.finished),
        evaluated=sum(not score.error for score in scores),
        best=shortened(rounds.best_value, TEXT_LIMIT),
        criteria=shortened(criteria, TEXT_LIMIT),
        stop=stop.kind if stop else "",
        stop_reason=shortened(stop.reason, TEXT_LIMIT) if stop else "",
    )


def _awaited(history: SearchHistory, grown: ProposedCampaign, told: int) -> int | None:
    """How many blocks must have ended before the search can go on: those of its oldest open batch.

    What no message has room for is asked for at once.
    """
    if not history.open:
        return None
    wanted = set(history.open[0].blocks)
    needed = max((n for n, block in enumerate(grown.blocks, 1) if block in wanted), default=0)
    return needed if needed <= told else len(grown.ended)
