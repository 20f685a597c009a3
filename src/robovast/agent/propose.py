"""`propose`: scores what a search has run, and stores what it runs next.

What decides is in the bucket. The pod of the next batch finds it there, and so does one that takes
the place of this one: it says the same.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from robovast.agent.bucket import Bucket
from robovast.agent.campaign import Campaign, download, load_inputs, open_campaign
from robovast.agent.compose import files_below, store_inputs
from robovast.agent.composed import Composed, store_grown
from robovast.agent.digests import check_files
from robovast.agent.mounts import Folders
from robovast.agent.process import add_to_run
from robovast.agent.untrusted_files import SIDE_BY_SIDE
from robovast.analysis.postprocessing.content import changed, scan
from robovast.base.atomic import write_atomically
from robovast.base.errors import InputError, StorageError
from robovast.campaign.configurations import read_variants
from robovast.campaign.layout import CAMPAIGN_STORE, CONFIGURATIONS, Layout
from robovast.campaign.places import run_of
from robovast.campaign.run_files import escaped
from robovast.execution.generate import write_configurations
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.pod_contract.messages import (
    BLOCKS_LIMIT,
    BREAKS_LIMIT,
    TEXT_LIMIT,
    Proposed,
    shortened,
)
from robovast.model.document import Document
from robovast.model.expansion import Composition, Variant, compose
from robovast.model.expansion.containers import refuse_containers
from robovast.model.growing import GrowingPlan
from robovast.model.naming import CONFIG
from robovast.model.packs import Block, format_breaks
from robovast.model.plan import breaks
from robovast.search.history import FOLDER, History
from robovast.search.plugins import make_extractor
from robovast.search.processing import call_postprocessing
from robovast.search.proposing import with_runs
from robovast.search.rounds import Rounds, Stop
from robovast.search.store import write_search_store
from robovast.storage.bucket_ownership import owner_of
from robovast.storage.download import Silent, download_campaign
from robovast.storage.folder_ownership import occupy


def propose(folders: Folders) -> AgentExit:
    """Go on with a search until it needs runs, or ends; say which.

    Raises:
        InputError: the document or its files are wrong, or a plugin fails.
        StorageError: the bucket cannot be read or written, or another pod was faster.
    """
    campaign = open_campaign(folders, connections=SIDE_BY_SIDE)
    campaign.bucket.claim()
    document = with_runs(load_inputs(campaign), campaign.plan.runs)
    grown = _open(campaign, document)
    history = History(grown.layout, partial(_keep, campaign.bucket, grown.layout))
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
    _words(rounds, grown, stop).write(folders.message)
    return AgentExit.PASSED


class _Log:
    """Writes what there is to say to the pod's log."""

    def message(self, text: str) -> None:
        """Say it."""
        print(text)  # noqa: T201


@dataclass
class ProposedCampaign(GrowingPlan):
    """A search's campaign in the cluster: what is executed stands in the mounted plan."""

    campaign: Campaign
    layout: Layout
    executed: Sequence[Block]
    """The blocks of the mounted plan: all of their runs have ended."""
    made: Composed | None
    """The variants of the mounted plan."""
    digest: str = ""
    """`CampaignPlan.composed` of all variants."""
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
        if list(blocks[: len(self.executed)]) != list(self.executed):
            raise InputError(
                f"{self.campaign.plan.bucket}/{FOLDER}: its batches are not those that the runs "
                "were planned with. They are written once and never changed: restore them from a "
                "copy, or create another Campaign."
            )
        self.blocks = list(blocks)

    def add_variants(self, document: Document, composition: Composition) -> None:
        """Store the inputs of further variants."""
        earlier, new = self.variants[: self.known], composition.variants
        bucket, name = self.campaign.bucket, document.path.name
        stored = store_inputs(self.campaign, document, composition, earlier)
        plugins = files_below(self.layout.config)
        for path in plugins:
            key = escaped(f"{CONFIG}/{path}")
            bucket.store.put_file(bucket.name, key, self.layout.config / path)
        before = self.made.inputs if self.made is not None else {}
        inputs = {**before, **plugins, **files_below(stored.config)}
        self.digest = store_grown(bucket, name, inputs, self.made, new)
        shutil.copyfile(stored.configurations, self.layout.configurations)
        self.variants = [*earlier, *new]

    def plan(self, blocks: Sequence[Block]) -> None:
        """Append blocks to the plan."""
        self.blocks += blocks

    def execute(self, blocks: Sequence[Block]) -> None:
        """Fetch the runs of blocks that are executed; others are left to the cluster."""
        if not set(blocks) <= set(self.executed):
            self.interrupted = True
            return
        wanted = {i for b in blocks for i in range(b.first_variant, b.first_variant + b.variants)}
        below = [f"{self.variants[index].name}/" for index in sorted(wanted)]
        plan, root = self.campaign.plan, self.layout.root
        download_campaign(self.campaign.store, plan.bucket, root, Silent(), below=below)


def _open(campaign: Campaign, document: Document) -> ProposedCampaign:
    """The campaign with its variants and its history, as far as the bucket has them.

    Raises:
        InputError: an input is not the one that the runs were planned with.
    """
    plan, layout = campaign.plan, Layout(campaign.folders.work / "results" / campaign.plan.campaign)
    shutil.rmtree(layout.root, ignore_errors=True)
    occupy(layout.root, owner_of(campaign.store, plan.bucket))
    download(campaign, f"{FOLDER}/", layout.root)
    made, variants = None, []
    if plan.composed is not None:
        made = Composed(campaign.bucket, layout, plan.composed, growing=True)
        check_files(made.inputs, document.folder)
        variants = _with_timings(campaign, layout, list(made))
    write_configurations(document, Composition(()), layout.root, timings=True, earlier=variants)
    executed = plan.plan.blocks if plan.plan is not None else ()
    digest = plan.composed or ""
    return ProposedCampaign(campaign, layout, executed, made, digest, variants=variants)


def _with_timings(campaign: Campaign, layout: Layout, planned: list[Variant]) -> list[Variant]:
    """The planned variants with the times at which they were made, as far as these are stored."""
    download(campaign, CONFIGURATIONS, layout.root)
    stored = {variant.name: variant for variant in read_variants(layout)[1]}
    return [stored.get(variant.name, variant) for variant in planned]


def _keep(bucket: Bucket, layout: Layout, path: Path, text: str) -> None:
    """Store a file of the history, which is written once.

    Raises:
        StorageError: another pod has stored another one.
    """
    key = path.relative_to(layout.root).as_posix()
    if not bucket.store.create(bucket.name, key, text.encode()):
        raise StorageError(
            f"{bucket.name}/{key}: another pod has stored it meanwhile. The next one reads it."
        )
    write_atomically(path, text)


def _expand(campaign: Campaign, document: Document) -> Composition:
    scratch = campaign.folders.scratch
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    return compose(document, scratch, print, refuse_containers)


def _elapsed(campaign: Campaign, history: History) -> float:
    """Time since the first batch was proposed, by the clock of the S3 server."""
    bucket = campaign.bucket
    begun = bucket.store.look(bucket.name, f"{FOLDER}/batch-0000.json")
    return max(history.elapsed, time.time() - begun.modified if begun else 0.0)


def _process(campaign: Campaign, document: Document, layout: Layout) -> None:
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
    left = grown.blocks[len(grown.executed) :][:BLOCKS_LIMIT]
    scores = rounds.history.scores().values()
    criteria = " | ".join(str(criterion) for criterion in rounds.criteria())
    return Proposed(
        blocks=tuple((b.first_variant, b.variants, b.first_run, b.runs) for b in left),
        variants=len(new),
        breaks=cuts,
        digest=grown.digest,
        batch=len(rounds.history.finished),
        evaluated=sum(not score.error for score in scores),
        best=shortened(rounds.best_value, TEXT_LIMIT),
        criteria=shortened(criteria, TEXT_LIMIT),
        stop=stop.kind if stop else "",
        stop_reason=shortened(stop.reason, TEXT_LIMIT) if stop else "",
    )
