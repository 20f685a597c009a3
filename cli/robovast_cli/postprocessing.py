"""Postprocessing in front of a user: progress while it runs, failures at the end."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import typer

from robovast.errors import ExitCode
from robovast.postprocessing.child import GROUP
from robovast.postprocessing.events import CampaignSummary, Failure, Options
from robovast.postprocessing.session import postprocess
from robovast_cli.output import say
from robovast_cli.plugin_list import described_plugins

MOST_LISTED = 20
"""Failures that the summary names at most."""
_GIVEN = ("results_dir", "config_dir", "provenance_file")
"""Parameters that no .vast file sets."""


class View:
    """Prints lines, and counts on a terminal."""

    def __init__(self) -> None:
        self._title, self._done, self._total = "", 0, 0
        self._live = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"

    def campaign_started(self, campaign: Path, runs: int) -> None:
        """Nothing to say yet: most often nothing has changed."""

    def step_started(self, title: str, total: int) -> None:
        """Begin to count."""
        self._title, self._done, self._total = title, 0, total
        self._count()

    def step_advanced(self) -> None:
        """Count."""
        self._done += 1
        self._count()

    def failed(self, failure: Failure) -> None:
        """The summary names it."""

    def message(self, text: str) -> None:
        """Print it."""
        self._clear()
        say(text)

    def campaign_finished(self, summary: CampaignSummary) -> None:
        """Say how it went."""
        self._clear()
        say(f"{summary.campaign.name}: {_outcome(summary)}")

    def _count(self) -> None:
        if self._live:
            of = f" {self._done}/{self._total} runs" if self._total > 1 else ""
            sys.stderr.write(f"\r\x1b[K{self._title}{of}")
            sys.stderr.flush()

    def _clear(self) -> None:
        if self._live:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


def run(results: Path, options: Options) -> ExitCode:
    """Postprocess the campaigns of a folder and say how it went."""
    summaries = postprocess(results, options, View())
    failures = [failure for summary in summaries for failure in summary.failures]
    for failure in failures[:MOST_LISTED]:
        typer.echo(f"failed: {failure}", err=True)
    if len(failures) > MOST_LISTED:
        typer.echo(f"… and {len(failures) - MOST_LISTED} more failures.", err=True)
    if any(summary.interrupted for summary in summaries):
        typer.echo("interrupted; what was finished is kept, the rest is done next time", err=True)
        return ExitCode.INTERRUPTED
    return min((failure.code for failure in failures), default=ExitCode.OK)


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
