"""Postprocess campaigns: report progress, and list failures at the end."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import typer

from robovast.analysis.postprocessing.child import GIVEN
from robovast.analysis.postprocessing.events import Failure, Options, PostprocessingSummary
from robovast.analysis.postprocessing.session import postprocess
from robovast.base.errors import ExitCode
from robovast.model.document.commands import GROUP
from robovast_cli.commands.results.plugin_list import described_plugins
from robovast_cli.ui.bars import Bars
from robovast_cli.ui.output import say
from robovast_cli.ui.report import tell

MOST_LISTED = 20
"""Maximum number of failures in the summary."""
_GIVEN = ("results_dir", "config_dir", *GIVEN)
"""Parameters that no .vast file sets."""


class View:
    """Prints lines; on a terminal with a progress bar below them."""

    def __init__(self) -> None:
        self._bars = Bars(of_bytes=False, transient=True)
        self._step = ("", 0, 0)

    def campaign_started(self, campaign: Path, runs: int) -> None:
        """Print nothing, because most campaigns have not changed."""

    def step_started(self, title: str, total: int) -> None:
        """Begin to count."""
        self.close()
        self._step = (title, 0, total)
        self._bars(*self._step)

    def step_advanced(self) -> None:
        """Count."""
        title, done, total = self._step
        self._step = (title, done + 1, total)
        self._bars(*self._step)

    def failed(self, failure: Failure) -> None:
        """The summary names it."""

    def message(self, text: str) -> None:
        """Print it."""
        self.close()
        say(text)

    def campaign_finished(self, summary: PostprocessingSummary) -> None:
        """Print the result of a campaign."""
        self.close()
        say(f"{summary.campaign.name}: {_outcome(summary)}")

    def close(self) -> None:
        """Remove the bar; the next step shows it again."""
        self._bars.close()


def run(results: Path, options: Options) -> ExitCode:
    """Postprocess the campaigns of a folder, and report the result."""
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
        typer.echo(f"… and {len(told) - MOST_LISTED} more failures", err=True)
    if any(summary.interrupted for summary in summaries):
        typer.echo(
            "interrupted; finished work is kept. Run the command again to continue.", err=True
        )
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


def _outcome(summary: PostprocessingSummary) -> str:
    runs = "1 run" if summary.runs == 1 else f"{summary.runs} runs"
    if not summary.commands and summary.failures:
        text = runs
    elif not summary.commands:
        why = "the .vast file has" if summary.document else "the campaign has no .vast file, so"
        done = "written" if summary.written else "up to date"
        text = f"{runs}, tables and metadata are {done} ({why} no commands)"
    elif not summary.worked:
        changed = ", ".join(summary.written)
        text = f"{runs}, {f'{changed} written' if changed else 'nothing changed'}"
    else:
        text = f"{runs}, {len(summary.worked)} processed"
    return text + (f", {len(summary.failures)} failed" if summary.failures else "")


def print_commands() -> None:
    """Print all installed commands, with an error for each that cannot be loaded."""
    typer.echo(described_plugins(GROUP, _GIVEN))
    typer.echo("\nTo use a command in a file, write `<path>.py:<name>`.")
