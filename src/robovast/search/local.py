"""Searches on this machine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.base.atomic import sync_folder, sync_tree
from robovast.base.stopwatch import Stopwatch
from robovast.campaign.configurations import read_configurations
from robovast.campaign.layout import Layout
from robovast.execution.generate import write_configurations, write_execution
from robovast.execution.local import (
    LocalOptions,
    Observer,
    Summary,
    planned_runs,
    recorded_seed,
    resume_campaign,
    run_campaign,
)
from robovast.execution.local.campaign import executing
from robovast.execution.local.choose import choose_runtime
from robovast.execution.local.growing import GrowingCampaign
from robovast.execution.local.session import Session
from robovast.execution.local.store import explained, make_campaign_folder, refuse_bytes
from robovast.execution.local.variants import campaign_seed, choose_variants
from robovast.model.document import Document, load_document
from robovast.model.expansion import Composition
from robovast.search.history import History
from robovast.search.plugins import make_extractor
from robovast.search.processing import call_postprocessing
from robovast.search.proposing import first_batch, with_runs
from robovast.search.rounds import Rounds, Stop
from robovast.search.store import write_search_store
from robovast.search.types import SearchReport

__all__ = ["SearchSummary", "execute_document", "resume"]


@dataclass(frozen=True)
class SearchSummary(Summary):
    """Result of a search."""

    stop: Stop | None = None
    """Why it ended; None if it was interrupted."""
    report: SearchReport | None = None
    scored: bool = True
    """False if every set was left out."""


def execute_document(
    document: Document, output: Path, options: LocalOptions, observer: Observer
) -> Summary:
    """Execute a new campaign, or a search where the document has one; see `run_campaign`."""
    if document.vast.search is None:
        return run_campaign(document, output, options, observer)
    return run_search(document, output, options, observer)


def resume(campaign: Path, options: LocalOptions, observer: Observer) -> Summary:
    """Continue a campaign or a search; see `resume_campaign`."""
    refuse_bytes(campaign)
    layout = Layout(campaign.absolute())
    document = load_document(layout.config / str(read_configurations(layout).get("vast")))
    if document.vast.search is None:
        return resume_campaign(campaign, options, observer)
    document = with_runs(document, options.runs or planned_runs(layout))
    runtime = choose_runtime(document, options, observer.message)
    session = Session(document, layout, options, runtime, runtime.check())
    return _search(session, observer)


def run_search(
    document: Document, output: Path, options: LocalOptions, observer: Observer
) -> Summary:
    """Execute a new search in a new subfolder of `output`.

    Raises:
        InputError: a plugin cannot be used, or the first batch cannot be made.
        CannotRunError: the runtime is not usable; nothing was started or created.
        StorageError: `output` cannot be written.
    """
    options = _without_ignored(options, observer.message)
    if options.runs is not None:
        document = with_runs(document, options.runs)
    make_extractor(document)
    with TemporaryDirectory(prefix="robovast-") as scratch:
        first_batch(document, Path(scratch), observer.message)
    runtime = choose_runtime(document, options, observer.message)
    identity = runtime.check()
    started = datetime.now().astimezone()
    layout = make_campaign_folder(output, document.vast.campaign_name, started)
    with explained(layout.root):
        write_configurations(document, Composition(()), layout.root, timings=True)
        write_execution(
            layout,
            document,
            started=started,
            runs=document.vast.execution.most_runs,
            kind="local",
            image=identity.image,
            image_revision=identity.digest,
            seed=campaign_seed(document),
        )
        sync_tree(layout.root)
        sync_folder(output)
    return _search(Session(document, layout, options, runtime, identity), observer)


def _without_ignored(options: LocalOptions, tell: Callable[[str], None]) -> LocalOptions:
    """The options without those that have no meaning in a search; says so."""
    ignored = {"--config": options.select, "--abort-on-failure": options.abort_on_failure}
    for name, given in ignored.items():
        if given:
            tell(f"{name} has no effect in a search.")
    return replace(options, select=None, abort_on_failure=False)


def _search(session: Session, observer: Observer) -> SearchSummary:
    layout, document = session.layout, session.document
    with (
        executing(session, observer) as told,
        TemporaryDirectory(prefix="robovast-") as scratch,
    ):
        history = History(layout)
        watch = Stopwatch(late=history.elapsed)
        campaign = GrowingCampaign(session, told, recorded_seed(layout))
        campaign.open(history.blocks)

        def expand(derived: Document) -> Composition:
            return choose_variants(derived, Path(scratch), session.options, told.message)

        def finished(stop: Stop | None) -> None:
            write_search_store(layout, document, history, stop)

        rounds = Rounds(
            document=document,
            campaign=campaign,
            history=history,
            extractor=make_extractor(document),
            process=lambda: call_postprocessing(document, layout.root, told.message),
            finished=finished,
            expand=expand,
            elapsed=lambda: watch.seconds,
        )
        stop = rounds.run()
        report = rounds.report()
    records = [record for _, record in sorted(campaign.records.items())]
    scores = history.scores().values()
    return SearchSummary(
        layout.root,
        campaign.total,
        records,
        campaign.interrupted,
        stop=stop,
        report=report,
        scored=not scores or any(not score.error for score in scores),
    )
