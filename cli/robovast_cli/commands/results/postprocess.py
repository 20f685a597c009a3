"""`vast results postprocess` and `vast results postprocess-commands`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from robovast.analysis.postprocessing import session
from robovast.analysis.postprocessing.child import GIVEN
from robovast.analysis.postprocessing.events import Failure, Options, PostprocessingSummary
from robovast.base.errors import ExitCode
from robovast.model.document.commands import GROUP
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.commands.results.plugin_list import describe_plugins
from robovast_cli.lazy import examples, exit_codes
from robovast_cli.ui.bars import Bars
from robovast_cli.ui.output import echo
from robovast_cli.ui.report import echo_stderr
from robovast_cli.ui.table import counted

MOST_LISTED = 20
"""Maximum number of failures in the summary."""
_GIVEN = ("results_dir", "config_dir", *GIVEN)
"""Parameters that no .vast file sets."""


@exit_codes(
    "0 all commands succeeded · 1 a command failed · 2 invalid .vast file · "
    "5 results cannot be written · 130 interrupted"
)
@examples(
    ("vast results postprocess", "Process all campaigns"),
    ("vast results postprocess -r results/hall-2026-03-04-152130 -f", "Process one again"),
    ("vast results postprocess --skip rosbags_to_csv --skip-rosout", "Skip commands"),
)
def postprocess(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Process unchanged results again.")
    ] = False,
    override: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--override",
            metavar="VAST_FILE",
            help="File whose commands replace the commands of each campaign.",
        ),
    ] = None,
    skip: Annotated[
        list[str] | None,
        typer.Option("--skip", metavar="PLUGIN", help="Command to skip (repeatable)."),
    ] = None,
    skip_rosout: Annotated[
        bool, typer.Option("--skip-rosout", help="Skip the conversion of ROS logs.")
    ] = False,
    skip_db: Annotated[
        bool,
        typer.Option(
            "--skip-db",
            help="Skip the tables of the campaign: tables.duckdb, data.db, campaign.db.",
        ),
    ] = False,
    skip_metadata: Annotated[
        bool, typer.Option("--skip-metadata", help="Skip metadata.yaml and metadata.prov.json.")
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            "-j",
            "--jobs",
            min=1,
            help="Number of runs processed in parallel (default: number of CPUs).",
        ),
    ] = None,
    time_limit: Annotated[
        float,
        typer.Option(
            "--time-limit",
            metavar="SECONDS",
            min=0.1,
            help="Time limit of a command in seconds, for a run or for a whole campaign.",
        ),
    ] = 3600.0,
    debug: Annotated[
        bool, typer.Option("--debug", help="Output of commands, with tracebacks.")
    ] = False,
) -> int:
    """Convert raw results into tables, metadata and a provenance graph.

    The commands are in `results_processing.postprocessing` of the .vast file. Unchanged results are
    skipped.
    """
    options = Options(
        override=override,
        force=force,
        skip=tuple(skip or ()),
        skip_rosout=skip_rosout,
        skip_tables=skip_db,
        skip_metadata=skip_metadata,
        jobs=jobs,
        time_limit=time_limit,
        debug=debug,
    )
    return postprocess_campaigns(results_dir or ctx.obj.results, options)


@examples(
    ("vast results postprocess-commands", "List the commands"),
    ("vast results postprocess-commands | less", "Page through the list"),
)
def postprocess_commands() -> None:
    """List the installed postprocessing commands and their parameters."""
    typer.echo(describe_plugins(GROUP, _GIVEN))
    typer.echo("\nTo use a command in a file, write `<path>.py:<name>`.")


class View:
    """Prints lines; on a terminal with a progress bar below them."""

    def __init__(self) -> None:
        self._bars = Bars(of_bytes=False, transient=True)
        self._step = ("", 0, 0)

    def campaign_started(self, campaign: Path, runs: int) -> None:
        """Print nothing, because most campaigns have not changed."""

    def step_started(self, title: str, total: int) -> None:
        """Show a bar that counts the parts of a step."""
        self.close()
        self._step = (title, 0, total)
        self._bars(*self._step)

    def step_advanced(self) -> None:
        """Advance the bar."""
        title, done, total = self._step
        self._step = (title, done + 1, total)
        self._bars(*self._step)

    def failed(self, failure: Failure) -> None:
        """Print nothing, because the failures are listed at the end."""

    def message(self, text: str) -> None:
        """Print a line."""
        self.close()
        echo(text)

    def campaign_finished(self, summary: PostprocessingSummary) -> None:
        """Print the result of a campaign."""
        self.close()
        echo(f"{summary.campaign.name}: {_outcome(summary)}")

    def close(self) -> None:
        """Remove the bar; the next step shows it again."""
        self._bars.close()


def postprocess_campaigns(results: Path, options: Options) -> ExitCode:
    """Postprocess the campaigns of a folder, and list failures at the end."""
    view = View()
    try:
        summaries = session.postprocess(results, options, view)
    finally:
        view.close()
    failures = [failure for summary in summaries for failure in summary.failures]
    lines = _failure_lines(failures)
    for line in lines[:MOST_LISTED]:
        echo_stderr(f"failed: {line}")
    if len(lines) > MOST_LISTED:
        typer.echo(f"… and {len(lines) - MOST_LISTED} more failures", err=True)
    if any(summary.interrupted for summary in summaries):
        typer.echo(
            "interrupted; finished work is kept. Run the command again to continue.", err=True
        )
        return ExitCode.INTERRUPTED
    return min((failure.code for failure in failures), default=ExitCode.OK)


def _failure_lines(failures: Iterable[Failure]) -> list[str]:
    """Return one line for all failures of a command with the same message in a campaign."""
    alike: dict[tuple[str, str, str], list[Failure]] = {}
    for failure in failures:
        key = (failure.campaign, failure.command, failure.message)
        alike.setdefault(key, []).append(failure)
    more = ((found[0], len(found) - 1) for found in alike.values())
    return [f"{first}" + (f" (and in {n} more runs)" if n else "") for first, n in more]


def _outcome(summary: PostprocessingSummary) -> str:
    runs = counted(summary.runs, "run")
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
