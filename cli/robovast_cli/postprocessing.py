"""Postprocessing in front of a user: progress while it runs, failures at the end."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import typer

from robovast.errors import ExitCode
from robovast.plugins import plugins_of
from robovast.postprocessing.child import GROUP
from robovast.postprocessing.events import CampaignSummary, Failure, Options
from robovast.postprocessing.session import postprocess
from robovast_cli.output import say
from robovast_cli.plugins import origin

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
    return ExitCode.TEST_FAILED if failures else ExitCode.OK


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
    points = sorted(plugins_of(GROUP).values(), key=lambda point: point.name)
    typer.echo("\n\n".join("\n".join(_described(point)) for point in points))
    typer.echo("\nA command in a file is written `<path>.py:<name>`; docs/postprocessing.md.")


def _described(point: EntryPoint) -> Iterator[str]:
    try:
        plugin = point.load()
    except Exception as error:
        yield f"{point.name}  (cannot be loaded: {type(error).__name__}: {error})"
        return
    yield f"{point.name}  ({origin(point)})"
    about = inspect.getdoc(plugin) or ""
    yield f"    {about.partition(chr(10) * 2)[0].replace(chr(10), ' ')}".rstrip()
    for name, parameter in _parameters(plugin).items():
        required = parameter.default is inspect.Parameter.empty
        yield f"    {name}: " + ("required" if required else f"{parameter.default!r} when omitted")


def _parameters(plugin: Any) -> dict[str, inspect.Parameter]:
    call = plugin.__call__ if inspect.isclass(plugin) else plugin
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {
        name: parameter
        for name, parameter in inspect.signature(call).parameters.items()
        if name not in (*_GIVEN, "self") and parameter.kind in kinds
    }
