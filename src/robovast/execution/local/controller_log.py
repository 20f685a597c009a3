"""`_execution/controller.log`: a log of a local campaign."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from robovast.base.printable import PrintableFormatter
from robovast.campaign.decisions import describe_decision
from robovast.campaign.layout import Layout
from robovast.campaign.run_record import RunRecord
from robovast.execution.local.events import ExecutionObserver
from robovast.execution.local.pack_queue import Decided
from robovast.execution.local.store import storage_errors
from robovast.model.plan import Run

FILE = "controller.log"

_log = logging.getLogger("robovast.campaign")
_log.propagate = False  # users see the observer's messages instead


@contextmanager
def logged(layout: Layout, observer: ExecutionObserver) -> Iterator[ExecutionObserver]:
    """Wrap an observer so that all events are also written to a campaign's log.

    Warnings of the whole library are written to that log, too.

    Raises:
        StorageError: the log cannot be written.
    """
    with storage_errors(layout.root):
        layout.execution.mkdir(exist_ok=True)
        handler = logging.FileHandler(layout.execution / FILE, encoding="utf-8")
    handler.setFormatter(PrintableFormatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    library = logging.getLogger("robovast")
    _log.setLevel(logging.INFO)
    for logger in (_log, library):
        logger.addHandler(handler)
    try:
        yield _Logged(observer)
    finally:
        for logger in (_log, library):
            logger.removeHandler(handler)
        handler.close()


@dataclass(frozen=True)
class _Logged:
    observer: ExecutionObserver

    def campaign_started(self, campaign: Path, total: int, done: int, how: str) -> None:
        """Log the campaign."""
        _log.info("%s: %d runs, %d done before; %s", campaign.name, total, done, how)
        self.observer.campaign_started(campaign, total, done, how)

    def runs_added(self, count: int) -> None:
        """Log their number."""
        _log.info("%d more runs", count)
        self.observer.runs_added(count)

    def run_started(self, run: Run) -> None:
        """Log the run."""
        _log.info("%s: started", run.path)
        self.observer.run_started(run)

    def run_finished(self, run: Run, record: RunRecord) -> None:
        """Log its verdict."""
        took = (
            f"reused from {record.reused_from}"
            if record.reused_from
            else f"after {record.duration:.1f} s"
        )
        _log.info("%s: %s %s. %s", run.path, record.verdict, took, record.reason)
        self.observer.run_finished(run, record)

    def configuration_decided(self, decided: Decided) -> None:
        """Log what it is."""
        _log.info("%s: %s", decided.variant, describe_decision(decided.decision))
        self.observer.configuration_decided(decided)

    def message(self, text: str) -> None:
        """Log the text."""
        _log.info("%s", text)
        self.observer.message(text)
