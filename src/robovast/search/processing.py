"""Postprocessing of a search: before a batch is scored, for all runs that are new."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from robovast.analysis.postprocessing.events import Failure, PostprocessingSummary
from robovast.analysis.postprocessing.session import call_commands
from robovast.model.document import Document
from robovast.search.plugins import make_extractor, search_of


def call_postprocessing(document: Document, campaign: Path, message: Callable[[str], None]) -> None:
    """Call the search's postprocessing, and bring the tables up to date if they are needed.

    Args:
        document: with the search.
        campaign: its folder.
        message: is given what fails.
    """
    search = search_of(document)
    tables = make_extractor(document).TABLES
    if search.postprocessing or tables:
        calls, told = search.postprocessing, _Failures(message)
        call_commands(campaign, document.path, calls, told, tables=tables)


@dataclass(frozen=True)
class _Failures:
    """Passes failures and messages of postprocessing on."""

    tell: Callable[[str], None]

    def campaign_started(self, campaign: Path, runs: int) -> None:
        pass

    def step_started(self, title: str, total: int) -> None:
        pass

    def step_advanced(self) -> None:
        pass

    def failed(self, failure: Failure) -> None:
        self.tell(f"postprocessing: {failure}")

    def message(self, text: str) -> None:
        self.tell(text)

    def campaign_finished(self, summary: PostprocessingSummary) -> None:
        pass
