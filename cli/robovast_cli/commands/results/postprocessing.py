"""Postprocessing in front of a user: progress while it runs, failures at the end."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import typer

from robovast.analysis.postprocessing.child import GIVEN
from robovast.analysis.postprocessing.events import CampaignSummary, Failure, Options
from robovast.analysis.postprocessing.session import postprocess
from robovast.base.errors import ExitCode
from robovast.base.printable import printable
from robovast.model.document.commands import GROUP
from robovast_cli.commands.results.plugin_list import described_plugins
from robovast_cli.ui.output import say
from robovast_cli.ui.report import tell

MOST_LISTED = 20
"""Failures that the summary names at most."""
_GIVEN = ("results_dir", "config_dir", *GIVEN)
"""Parameters that no .vast file sets."""


class View:
    """Prints lines; on a terminal with a progress bar below them."""

    def __init__(self) -> None:
        live = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        self._bar = _Bar() if live else None

    def campaign_started(self, campaign: Path, runs: int) -> None:
        """Nothing to say yet: most often nothing has changed."""

    def step_started(self, title: str, total: int) -> None:
        """Begin to count."""
        if self._bar:
            self._bar.start(title, total)

    def step_advanced(self) -> None:
        """Count."""
        if self._bar:
            self._bar.advance()

    def failed(self, failure: Failure) -> None:
        """The summary names it."""

    def message(self, text: str) -> None:
        """Print it."""
        self.close()
        say(text)

    def campaign_finished(self, summary: CampaignSummary) -> None:
        """Say how it went."""
        self.close()
        say(f"{summary.campaign.name}: {_outcome(summary)}")

    def close(self) -> None:
        """Take the bar away; the next step brings it back."""
        if self._bar:
            self._bar.stop()


class _Bar:
    """How far the present step is, on stderr."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )

        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        self._progress = Progress(*columns, console=Console(stderr=True), transient=True)
        self._task: Any = None

    def start(self, title: str, total: int) -> None:
        self.stop()
        self._task = self._progress.add_task(printable(title), total=total)
        self._progress.start()

    def advance(self) -> None:
        if self._task is not None:
            self._progress.advance(self._task)

    def stop(self) -> None:
        if self._task is not None:
            self._progress.stop()
            self._progress.remove_task(self._task)
            self._task = None


def run(results: Path, options: Options) -> ExitCode:
    """Postprocess the campaigns of a folder and say how it went."""
    view = View()
    try:
        summaries = postprocess(results, options, view)
    finally:
        view.close()
    failures = [failure for summary in summaries for failure in summary.failures]
    told = _told_once(failures)
    for text in told[:MOST_LISTED]:
        tell(f"failed: {text}")
    if len(told) > MOST_LISTED:
        typer.echo(f"… and {len(told) - MOST_LISTED} more failures.", err=True)
    if any(summary.interrupted for summary in summaries):
        typer.echo("interrupted; what was finished is kept, the rest is done next time", err=True)
        return ExitCode.INTERRUPTED
    return min((failure.code for failure in failures), default=ExitCode.OK)


def _told_once(failures: Iterable[Failure]) -> list[str]:
    """Failures as lines; of one command for one reason there is one, however many runs it hit."""
    alike: dict[tuple[str, str, str], list[Failure]] = {}
    for failure in failures:
        key = (failure.campaign, failure.command, failure.message)
        alike.setdefault(key, []).append(failure)
    more = ((found[0], len(found) - 1) for found in alike.values())
    return [f"{first}" + (f" (and in {n} more runs)" if n else "") for first, n in more]


def _outcome(summary: CampaignSummary) -> str:
    runs = "1 run" if summary.runs == 1 else f"{summary.runs} runs"
    if not summary.commands:
        text = f"{runs}, no commands"
    elif not summary.worked:
        text = f"{runs}, nothing changed"
    else:
        text = f"{runs}, {len(summary.worked)} worked on"
    return text + (f", {len(summary.failures)} failed" if summary.failures else "")


def print_commands() -> None:
    """Print every installed command; one that cannot be loaded says why."""
    typer.echo(described_plugins(GROUP, _GIVEN))
    typer.echo("\nA command in a file is written `<path>.py:<name>`; docs/postprocessing.md.")
