"""Searches on this machine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.base.atomic import sync_folder, sync_tree
from robovast.base.errors import InputError
from robovast.base.stopwatch import Stopwatch
from robovast.base.yaml_files import read_mapping
from robovast.campaign.configurations import document_path, read_configurations
from robovast.campaign.layout import Layout
from robovast.execution.generate import write_configurations, write_execution
from robovast.execution.local import (
    ExecutionObserver,
    ExecutionSummary,
    LocalOptions,
    record_again,
    recorded_runs,
    recorded_seed,
    resume_campaign,
    run_campaign,
)
from robovast.execution.local.campaign import executing
from robovast.execution.local.choose import choose_runtime, trusted_code
from robovast.execution.local.continuing import continued_session
from robovast.execution.local.edited_inputs import record_inputs
from robovast.execution.local.growing import GrowingCampaign
from robovast.execution.local.limits import check_limits
from robovast.execution.local.session import Session
from robovast.execution.local.store import make_campaign_folder, refuse_bytes, storage_errors
from robovast.execution.local.variants import campaign_seed, choose_variants
from robovast.model.document import Document, load_document
from robovast.model.expansion import Composition
from robovast.model.plan import plan_variants
from robovast.search.batches import Rounds
from robovast.search.ending import Stop
from robovast.search.history import SearchHistory
from robovast.search.plugins import make_extractor
from robovast.search.processing import call_postprocessing
from robovast.search.proposing import first_batch, with_batches, with_runs
from robovast.search.store import write_search_store
from robovast.search.types import SearchReport

__all__ = ["SearchSummary", "execute_document", "resume"]


@dataclass(frozen=True)
class SearchSummary(ExecutionSummary):
    """Result of a search."""

    stop: Stop | None = None
    """Why it ended; None if it was interrupted."""
    report: SearchReport | None = None
    sets: int = 0
    """How many were evaluated."""
    errors: Sequence[str] = ()
    """Why sets were left out, one of each."""

    @property
    def scored(self) -> bool:
        """False if every set was left out."""
        return not self.sets or len(self.errors) < self.sets


def execute_document(
    document: Document, output: Path, options: LocalOptions, observer: ExecutionObserver
) -> ExecutionSummary:
    """Execute a new campaign, or a search where the document has one; see `run_campaign`."""
    if document.vast.search is None:
        _refuse_batches(document, options)
        return run_campaign(document, output, options, observer)
    return run_search(document, output, options, observer)


def _refuse_batches(document: Document, options: LocalOptions) -> None:
    if options.batches is not None:
        raise InputError(
            f"{document.path}: has no `search`, and only a search has `--batches`.",
            hint="add a `search`, or remove `--batches`",
        )


def resume(campaign: Path, options: LocalOptions, observer: ExecutionObserver) -> ExecutionSummary:
    """Continue a campaign or a search; see `resume_campaign`."""
    refuse_bytes(campaign)
    layout = Layout(campaign.absolute())
    with trusted_code(layout.root, options):
        document = load_document(document_path(layout, read_configurations(layout)))
    if document.vast.search is None:
        _refuse_batches(document, options)
        return resume_campaign(campaign, options, observer)
    options = _without_ignored(options, observer.message)
    document = with_runs(document, options.runs or recorded_runs(layout).each)
    _refuse_fewer(layout, options.batches)  # before anything is prepared
    session = continued_session(document, layout, options, observer)
    return _search(session, observer)


def _each_once(tell: Callable[[str], None]) -> Callable[[str], None]:
    """Tells each text once: every set is expanded alike, and says the same."""
    told: set[str] = set()

    def print_once(text: str) -> None:
        if text not in told:
            told.add(text)
            tell(text)

    return print_once


def recorded_batches(layout: Layout) -> int | None:
    """The batches that a search was last told to end after; None where its document says it.

    Raises:
        InputError: what is recorded is no number of batches.
    """
    found = read_mapping(layout.execution_record).get("batches")
    if found is None or (type(found) is int and found > 0):
        return found
    raise InputError(
        f"{layout.execution_record}: `batches` must be at least 1, not {found!r}.",
        hint="restore the file",
    )


def _refuse_fewer(layout: Layout, batches: int | None) -> None:
    """Refuse a number of batches with which nothing would be executed.

    Raises:
        InputError: so many are done.
    """
    done = len(SearchHistory(layout).finished)
    if batches is not None and batches <= done:
        raise InputError(
            f"{layout.root} has {done} batches, and `--batches` counts all of them",
            hint=f"use a number greater than {done}",
        )


def run_search(
    document: Document, output: Path, options: LocalOptions, observer: ExecutionObserver
) -> ExecutionSummary:
    """Execute a new search in a new subfolder of `output`.

    Raises:
        InputError: a plugin cannot be used, containers are limited to what is no amount, or the
            first batch cannot be made.
        CannotRunError: the runtime is not usable; nothing was started or created.
        StorageError: `output` cannot be written.
    """
    check_limits(document)
    options = _without_ignored(options, observer.message)
    if options.runs is not None:
        document = with_runs(document, options.runs)
    make_extractor(document)
    with TemporaryDirectory(prefix="robovast-") as scratch:
        first = first_batch(document, Path(scratch), _each_once(observer.message))
        plan_variants(first.variants, document.vast.execution.most_runs)  # refuses too many runs
    runtime = choose_runtime(document, options, observer.message)
    identity = runtime.check()
    started = datetime.now().astimezone()
    layout = make_campaign_folder(output, document.vast.campaign_name, started)
    with storage_errors(layout.root):
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
        record_inputs(document, layout)
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


def _search(session: Session, observer: ExecutionObserver) -> SearchSummary:
    layout = session.layout
    with (
        executing(session, observer) as told,
        TemporaryDirectory(prefix="robovast-") as scratch,
    ):
        _refuse_fewer(layout, session.options.batches)  # another program may have done more since
        if session.options.batches is not None:
            record_again(layout, {"batches": session.options.batches})
        document = with_batches(session.document, recorded_batches(layout))
        history = SearchHistory(layout)
        watch = Stopwatch(late=history.elapsed)
        campaign = GrowingCampaign(session, told, recorded_seed(layout))
        campaign.open(history.blocks)

        tell = _each_once(told.message)

        def expand(derived: Document) -> Composition:
            return choose_variants(derived, Path(scratch), session.options, tell)

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
        if session.options.runs is not None and rounds.stop() is not None:
            told.message(
                "--runs has no effect, because the search has ended; also set `--batches`."
            )
        with campaign.working():
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
        sets=len(scores),
        errors=[score.error for score in scores if score.error],
    )
