"""Executes a campaign on this machine: parallel jobs, each run stored once."""

from __future__ import annotations

import queue
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from threading import Event, Thread

from robovast.base.atomic import write_atomically
from robovast.base.locks import exclusive_folder
from robovast.base.sequential import SequentialTest
from robovast.base.serialization import dump_yaml
from robovast.base.signals import call_on_signals
from robovast.campaign.layout import JOB_LINKS, Layout
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.execution.contract import contract_files
from robovast.execution.generate import copy_file
from robovast.execution.local.choose import trusted_code
from robovast.execution.local.controller_log import logged
from robovast.execution.local.edited_inputs import edited_inputs_warning
from robovast.execution.local.events import ExecutionObserver, ExecutionSummary
from robovast.execution.local.measured_queue import MeasuredQueue
from robovast.execution.local.pack_execution import PackExecution
from robovast.execution.local.pack_queue import (
    Decided,
    DecidingQueue,
    FixedQueue,
    PackQueue,
    decisions_of,
)
from robovast.execution.local.reuse import reused_runs, why_nothing
from robovast.execution.local.session import COMMON, Session
from robovast.execution.local.store import finished_runs, first_free_job, storage_errors
from robovast.execution.local.stored_inputs import refuse_links
from robovast.model.inputs import container_files
from robovast.model.packing import PackSample
from robovast.model.packs import PlanSpec
from robovast.model.plan import PackStart, Run


def execute_campaign(
    session: Session,
    plan: PlanSpec,
    runs: Sequence[Run],
    observer: ExecutionObserver,
    test: SequentialTest | None = None,
) -> ExecutionSummary:
    """Execute all these runs of a plan that have no finished record yet.

    Args:
        session: how they are executed.
        plan: their plan.
        runs: the runs.
        observer: is told what happens.
        test: as many runs of each configuration are executed as it takes; None for all.

    Raises:
        StorageError: another program executes the campaign, or results cannot be stored.
    """
    with executing(session, observer) as told:
        return execute_planned(session, plan, runs, told, test)


def execute_planned(
    session: Session,
    plan: PlanSpec,
    runs: Sequence[Run],
    observer: ExecutionObserver,
    test: SequentialTest | None = None,
) -> ExecutionSummary:
    """The same within `executing`."""
    done = stored_runs(session, runs, observer)
    observer.campaign_started(session.layout.root, len(runs), len(done), how(session, len(runs)))
    records, interrupted = execute_runs(session, plan, runs, done, observer, test)
    write_job_links(session.layout, records)
    found = [records[run.id] for run in runs if run.id in records]
    decided = decisions_of(test, runs, records) if test is not None else []
    return ExecutionSummary(session.layout.root, len(runs), found, interrupted, decided)


@contextmanager
def executing(session: Session, observer: ExecutionObserver) -> Iterator[ExecutionObserver]:
    """Have a campaign for this program alone, with its log and its common inputs.

    Raises:
        InputError: a folder of the campaign is a link.
        StorageError: another program executes the campaign.
    """
    refuse_links(session.layout)
    root = session.layout.root
    refusal = f"{root}: another `vast` is running this campaign"
    hint = "wait until it finishes, or stop it"
    with (
        exclusive_folder(session.layout.running, refusal, hint),
        logged(session.layout, observer) as told,
        trusted_code(session.layout.root, session.options),
    ):
        session.runtime.clean_up_campaign(session.token)
        _prepare_common(session)
        if edited := edited_inputs_warning(session.layout):
            told.message(edited)
        if session.is_imported and session.sets_user:
            told.message(
                f"`execution.run_as_user` is ignored, because the campaign was imported; its "
                f"containers run as user {session.user_id}."
            )
        if session.options.reuse and (why := why_nothing(session)):
            told.message(f"Nothing is reused: {why}")
        yield told


def stored_runs(
    session: Session, runs: Sequence[Run], observer: ExecutionObserver
) -> dict[int, RunRecord]:
    """Records of the runs that need not be executed again, by id."""
    with storage_errors(session.layout.root):
        return finished_runs(session, runs, observer.message)


def how(session: Session, runs: int) -> str:
    """The runtime and the number of parallel jobs, in words."""
    return f"{session.runtime.name}, {min(session.jobs_side_by_side, runs)} in parallel"


def execute_runs(
    session: Session,
    plan: PlanSpec,
    runs: Sequence[Run],
    done: dict[int, RunRecord],
    observer: ExecutionObserver,
    test: SequentialTest | None = None,
) -> tuple[dict[int, RunRecord], bool]:
    """Execute the runs of a plan that are not done and that a test needs, within `executing`.

    Returns:
        All records by id, and whether the user interrupted.
    """
    missing = [run for run in runs if run.id not in done]
    done = done | reused_runs(session, plan, missing, first_free_job(session.layout), observer)
    todo = [run for run in runs if run.id not in done]
    first_job = first_free_job(session.layout)
    packs: PackQueue = FixedQueue(plan, todo, first_job)
    if session.document.vast.execution.packs_are_measured:
        packs = MeasuredQueue(plan, todo, first_job, session.jobs_side_by_side)
    if test is not None:
        packs = DecidingQueue(test, runs, done, first_job, plan.runs_per_job)
        for decided in packs.decided_before:
            observer.configuration_decided(decided)
    execution = CampaignExecution(session, packs, observer, done)
    execution.begin(min(session.jobs_side_by_side, len(todo)))
    execution.wait()
    return execution.records, execution.interrupted


def _prepare_common(session: Session) -> None:
    """A private copy of the shared inputs, since runs may change it but never the originals."""
    common = session.layout.running / COMMON
    with storage_errors(session.layout.root):
        shutil.rmtree(common, ignore_errors=True)
        for path in container_files(session.document):
            copy_file(session.document.folder / path, common / path)
        for script in contract_files():
            copy_file(script, common / script.name)
        _ = session.conditions  # of these files before any run could change them


def write_job_links(layout: Layout, records: dict[int, RunRecord]) -> None:
    """Record which job executed which run."""
    links = {f"{record.variant}/{record.run}": record.job for record in records.values()}
    with storage_errors(layout.root):
        write_atomically(layout.root / JOB_LINKS, dump_yaml(links))


class CampaignExecution:
    """Workers take jobs; their reports are handled in the caller's thread."""

    def __init__(
        self,
        session: Session,
        packs: PackQueue,
        observer: ExecutionObserver,
        done: dict[int, RunRecord],
    ) -> None:
        self.records = dict(done)
        self._packs = packs
        self._session = session
        self._observer = observer
        self._events: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stop = Event()
        self._drain = Event()
        self._failure: BaseException | None = None
        self._threads: list[Thread] = []
        self.interrupted = False
        """Whether the user interrupted it."""

    def begin(self, workers: int) -> None:
        """Start workers."""
        self._threads = [
            Thread(target=self._work_to_the_end, name=f"job-{n}") for n in range(workers)
        ]
        for thread in self._threads:
            thread.start()

    def wait(self, enough: Callable[[], bool] = lambda: False) -> None:
        """Handle what workers report until it is enough, or until all of them have ended.

        Raises:
            StorageError: results cannot be stored.
        """
        with call_on_signals(self._interrupt):
            while self._is_under_way and not enough():
                self._handle_event()
        if self._failure is not None:
            raise self._failure

    @property
    def is_stopping(self) -> bool:
        """Whether workers take nothing any more, since they were interrupted or one has failed."""
        return self._stop.is_set()

    def stop(self) -> None:
        """Make workers end their current runs and take no others."""
        self._stop.set()

    @property
    def _is_under_way(self) -> bool:
        return any(thread.is_alive() for thread in self._threads) or not self._events.empty()

    def _interrupt(self) -> None:
        if not self.interrupted:
            stopping = "Stopping: waiting for running scenarios to end …"
            self._events.put(lambda: self._observer.message(stopping))
        self.interrupted = True
        self.stop()

    def _handle_event(self) -> None:
        try:
            event = self._events.get(timeout=0.2)
        except queue.Empty:
            return
        event()

    def _work_to_the_end(self) -> None:
        self._work()
        self._events.put(lambda: None)  # wakes up the caller's thread

    def _work(self) -> None:
        while (job := self._take()) is not None:
            took: list[float] = []
            report = partial(self._report_finished, took)
            execution = PackExecution(self._session, job, self._stop, self._report_started, report)
            began = time.monotonic()
            try:
                left = execution.execute()
            except BaseException as error:  # raised again in the caller's thread
                self._failure = self._failure or error
                self._stop.set()
                return
            self._packs.measured(PackSample(len(took), sum(took), time.monotonic() - began))
            if left and not self._stop.is_set():
                self._packs.put_back(left)

    def _take(self) -> PackStart | None:
        if self._stop.is_set() or self._drain.is_set():
            return None
        return self._packs.take()

    def _report_started(self, run: Run) -> None:
        self._events.put(lambda: self._observer.run_started(run))

    def _report_finished(self, took: list[float], run: Run, record: RunRecord) -> None:
        took.append(record.duration)
        if record.verdict is not Verdict.PASSED and self._session.options.abort_on_failure:
            self._drain.set()
        decided = self._packs.ended(run, record.verdict)
        self._events.put(lambda: self._finish(run, record, decided))

    def _finish(self, run: Run, record: RunRecord, decided: Decided | None) -> None:
        self.records[run.id] = record
        self._observer.run_finished(run, record)
        if decided is not None:
            self._observer.configuration_decided(decided)
