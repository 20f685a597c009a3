"""Re-run a run in front of a user and print the comparison."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from robovast.analysis.replay.report import Replayed, ReplayReport, report_replays
from robovast.base.atomic import write_atomically
from robovast.base.errors import ExitCode, InputError
from robovast.campaign.layout import REPLAY
from robovast.execution.local import LocalOptions, replay_run
from robovast.execution.local.replay import find_run
from robovast.model.document import load_document
from robovast.model.document.execution import Output
from robovast_cli.ui.campaign import view
from robovast_cli.ui.output import say
from robovast_cli.workspace import shown

DIFFERS = ExitCode.TEST_FAILED
"""As `diff` ends when files differ."""

MOST_LISTED = 10
"""Replays with another result that are listed, and differences of each."""


def replayed(
    folder: Path, output: Path, times: int, patterns: list[str] | None, **options: Any
) -> ExitCode:
    """Re-run a run, print the comparison, and return the exit code."""
    run = find_run(folder)
    document = load_document(run.layout.config / str(run.configurations["vast"]))
    compared: Sequence[Output] | None = document.vast.execution.compare
    if patterns:
        compared = [_output(pattern) for pattern in patterns]
    with view() as shows:
        summary = replay_run(run, output, times, LocalOptions(**options), shows)
    if summary.interrupted:
        say(f"Interrupted. Finished re-runs: {shown(summary.campaign)}")
        return ExitCode.INTERRUPTED
    replays = [summary.campaign / run.variant.name / str(r.run) for r in summary.records]
    report = report_replays(run.folder, replays, compared)
    lines = list(_lines(report))
    for line in ("", *lines):
        say(line)
    record = {"of": run.full_path, "same": not report.differs, "text": lines}
    write_atomically(summary.campaign / REPLAY, json.dumps(record, indent=1) + "\n")
    say(f"Results: {shown(summary.campaign)}")
    return DIFFERS if report.differs else ExitCode.OK


def _lines(report: ReplayReport) -> Iterator[str]:
    seed = "no seed" if report.seed is None else f"seed {report.seed}"
    if len(report.replays) == 1:
        yield from _one(report, f"{report.run} ({seed})")
        return
    same = sum(replay.is_as_before for replay in report.replays)
    yield f"{report.run} ({seed}): {same} of {len(report.replays)} re-runs have the same result."
    others = [replay for replay in report.replays if not replay.is_as_before]
    for replay in others[:MOST_LISTED]:
        yield f"  {shown(replay.folder)}: {_verdicts(report, replay)}"
        yield from _differences(replay)
    if len(others) > MOST_LISTED:
        yield f"  … and {len(others) - MOST_LISTED} more."
    yield from _told(report)


def _one(report: ReplayReport, run: str) -> Iterator[str]:
    (replay,) = report.replays
    same = f", same {', '.join(replay.outputs.same)}" if replay.outputs.same else ""
    if replay.is_as_before:
        nothing = "" if same else "; no output was compared because none matches"
        yield f"{run}: same verdict ({report.verdict}){same}{nothing}."
        return
    yield f"{run} differs: {_verdicts(report, replay)}{same}."
    yield from _differences(replay)


def _verdicts(report: ReplayReport, replay: Replayed) -> str:
    if replay.verdict is report.verdict:
        return f"same verdict ({report.verdict})"
    reason = f" ({replay.reason})" if replay.reason else ""
    return f"{replay.verdict}{reason} instead of {report.verdict}"


def _differences(replay: Replayed) -> Iterator[str]:
    found = replay.outputs.differences
    yield from (f"    {difference}" for difference in found[:MOST_LISTED])
    if len(found) > MOST_LISTED:
        yield f"    … and {len(found) - MOST_LISTED} more outputs."


def _told(report: ReplayReport) -> Iterator[str]:
    if report.flaky:
        yield (
            "Nondeterministic: the same seed gives different results. The cause is the simulator "
            "or the test setup, not the robot."
        )
    elif report.flaky is False:
        yield "Deterministic: the same seed gives the same result each time" + (
            ", but not the result of the stored run. Check for changes." if report.differs else "."
        )
    variant = report.run.partition("/")[0]
    counts = ", ".join(f"{count} {verdict}" for verdict, count in report.other_seeds.items())
    others = f"runs of {variant} with other seeds: {counts}"
    if report.chancy:
        yield f"Seed-dependent: the verdict depends on the seed ({others})."
    elif report.chancy is False:
        yield f"Not seed-dependent so far: other seeds give the same verdict ({others})."


def _output(pattern: str) -> Output:
    try:
        return Output(pattern=pattern)
    except ValidationError:
        raise InputError(
            f"--compare {pattern!a}: must be a glob pattern of files in the run folder, such as "
            "`out/*.csv`, or of bags with a topic, such as `*.mcap:/odom`."
        ) from None
