"""`vast replay`: run a stored run again and compare the results."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer
from pydantic import ValidationError

from robovast.analysis.replay.report import Replayed, ReplayReport, report_replays
from robovast.base.atomic import write_atomically
from robovast.base.errors import ExitCode, InputError
from robovast.campaign.layout import REPLAY
from robovast.execution.local import LocalOptions, replay_run
from robovast.execution.local.replay import find_run
from robovast.model.document import load_document
from robovast.model.document.execution import Output
from robovast.model.naming import is_run_number
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import examples, exit_codes
from robovast_cli.ui.campaign import view
from robovast_cli.ui.output import echo
from robovast_cli.workspace import shown

DIFFERS = ExitCode.TEST_FAILED
"""Exit code if a re-run differs, as of `diff`."""
MOST_LISTED = 10
"""Maximum number of listed re-runs with another result, and of differences of each."""

Runtime = Annotated[
    Literal["same", "docker", "podman", "process"],
    typer.Option("--runtime", help="Runtime; `same` is the runtime of the stored run."),
]
Image = Annotated[
    str | None,
    typer.Option("--image", help="Container image (default: the image of the stored run)."),
]
Out = Annotated[
    Path,
    typer.Option(
        "-o", "--output", "--out", metavar="PATH", help="Parent folder of the new campaign."
    ),
]


@exit_codes("0 all re-runs match · 1 a re-run differs · 130 interrupted")
@examples(
    ("vast replay results/hall-2026-03-04-152130/hall-1/0", "Run it again"),
    ("vast replay results/hall-2026-03-04-152130/hall-1/0 --times 10", "Check for nondeterminism"),
)
def replay(
    run: Annotated[
        Path,
        typer.Argument(
            metavar="RUN",
            help="Run as <campaign>/<configuration>/<run>: a folder, or a name in the object "
            "storage of the cluster.",
        ),
    ],
    times: Annotated[
        int,
        typer.Option(
            "--times",
            min=1,
            max=100_000,
            help="Number of re-runs. With 2 or more, also report whether they are "
            "nondeterministic.",
        ),
    ] = 1,
    out: Out = Path("replays"),
    compare: Annotated[
        list[str] | None,
        typer.Option(
            "--compare",
            metavar="GLOB",
            help="Output to compare (default: `execution.compare`, else all CSV files) "
            "(repeatable).",
        ),
    ] = None,
    runtime: Runtime = "same",
    image: Image = None,
    jobs: Annotated[
        int, typer.Option("-j", "--jobs", min=1, help="Number of re-runs in parallel.")
    ] = 1,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Run a stored run again and compare the results.

    Uses the files, parameters, seed and image of the stored run, and compares verdict and outputs.
    The stored run is not modified.
    """
    stored = find_run(get_run(run, out, context, namespace))
    document = load_document(stored.layout.config / str(stored.configurations["vast"]))
    compared: Sequence[Output] | None = document.vast.execution.compare
    if compare:
        compared = [_output(pattern) for pattern in compare]
    options = LocalOptions(runtime=runtime, image=image, jobs=jobs)
    with view() as progress:
        summary = replay_run(stored, out, times, options, progress)
    if summary.interrupted:
        echo(f"Interrupted. Finished re-runs: {shown(summary.campaign)}")
        return ExitCode.INTERRUPTED
    replays = [summary.campaign / stored.variant.name / str(r.run) for r in summary.records]
    report = report_replays(stored.folder, replays, compared)
    lines = list(_lines(report))
    for line in ("", *lines):
        echo(line)
    record = {"of": stored.full_path, "same": not report.differs, "text": lines}
    write_atomically(summary.campaign / REPLAY, json.dumps(record, indent=1) + "\n")
    echo(f"Results: {shown(summary.campaign)}")
    return DIFFERS if report.differs else ExitCode.OK


def get_run(run: Path, out: Path, context: str | None, namespace: str | None) -> Path:
    """Return the folder of a run, downloaded below `out` if only a cluster has it."""
    if not is_stored_elsewhere(run):
        if context or namespace:
            option = "`--context`" if context else "`-n` (`--namespace`)"
            count = namespace if namespace and namespace.isdecimal() else None
            times = f". For {count} re-runs, use `vast replay --times {count}`" if count else ""
            raise InputError(
                f"{run} is on this machine, but {option} selects a run on a cluster",
                hint=f"remove {option}{times}",
            )
        return run
    from robovast_cli.commands.results.download import download_run

    return download_run(context, namespace, str(run), out / "originals")


def is_stored_elsewhere(run: Path) -> bool:
    """Whether a run is not on this machine, but may be on a cluster."""
    here = run.is_absolute() or run.parent.parent.exists()
    return not here and len(run.parts) == 3 and is_run_number(run.name)


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
    yield from _findings(report)


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


def _findings(report: ReplayReport) -> Iterator[str]:
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
            f"--compare {pattern!a}: is not a valid pattern",
            hint="use a glob pattern of files in the run folder, such as `out/*.csv`, or of "
            "bags with a topic, such as `*.mcap:/odom`",
        ) from None
