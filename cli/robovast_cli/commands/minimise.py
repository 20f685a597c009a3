"""`vast minimise`: reduce the parameters of a failed run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from robovast.analysis.minimise.minimising import End, Minimised, continue_minimising, minimise_run
from robovast.analysis.minimise.record import MinimiseStep
from robovast.analysis.minimise.record import shown as shown_value
from robovast.analysis.minimise.shrinking import Items, Ladder
from robovast.base.errors import ExitCode, InputError
from robovast.base.sequential import SequentialTest
from robovast.base.statistics import anytime, interval_text
from robovast.evaluation.launch.commands import as_shell
from robovast.execution.local import LocalOptions
from robovast.execution.local.replay import find_run
from robovast_cli.commands.replay import Image, Out, Runtime, get_run
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import examples, exit_codes
from robovast_cli.ui.campaign import view
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import format_table
from robovast_cli.workspace import shown

ERROR = 0.1
"""Probability of a wrong decision about a step."""
MOST = 20
"""Maximum number of runs of a step, unless a passing step needs more."""


@exit_codes("0 reduced, or the budget is used up · 130 interrupted")
@examples(
    ("vast minimise results/hall-2026-03-04-152130/hall-1/0", "Reduce a failure"),
    ("vast minimise results/hall-2026-03-04-152130/hall-1/0 --budget 100", "Use fewer runs"),
)
def minimise(
    run: Annotated[
        Path,
        typer.Argument(
            metavar="RUN",
            help="Failed run as <campaign>/<configuration>/<run>: a folder, or a name in the "
            "object storage of the cluster.",
        ),
    ],
    budget: Annotated[
        int,
        typer.Option(
            "--budget", min=1, metavar="RUNS", help="Number of runs after which no step starts."
        ),
    ] = 200,
    good: Annotated[
        float, typer.Option(metavar="RATE", help="Highest failure rate of a passing step.")
    ] = 0.1,
    bad: Annotated[
        float, typer.Option(metavar="RATE", help="Lowest failure rate of a failing step.")
    ] = 0.5,
    out: Out = Path("minimised"),
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Campaign folder of an interrupted `vast minimise` of this run, to resume.",
        ),
    ] = None,
    runtime: Runtime = "same",
    image: Image = None,
    jobs: Annotated[int, typer.Option("-j", "--jobs", min=1, help="Number of parallel runs.")] = 1,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Reduce the parameters of a failed run.

    Finds the fewest list items and the least extreme values that still fail. Moves values toward
    those of passing configurations of the campaign, else toward the defaults of the scenario.
    Each step runs until a sequential test decides whether it still fails for the same cause. The
    stored run is not modified.
    """
    folder = get_run(run, out, context, namespace)
    test = _test(good, bad)
    options = LocalOptions(runtime=runtime, image=image, jobs=jobs)
    stored = find_run(folder)
    with view() as progress:
        if resume is None:
            found = minimise_run(stored, out, test, budget, options, progress)
        else:
            found = continue_minimising(stored, resume, budget, options, progress)
    for line in _lines(found, folder, budget):
        echo(line)
    return ExitCode.INTERRUPTED if found.end is End.INTERRUPTED else ExitCode.OK


def _test(good: float, bad: float) -> SequentialTest:
    if not 0 < good < bad < 1:
        raise InputError(
            f"--good must be less than --bad, and both must be between 0 and 1 (got {good:g} and "
            f"{bad:g}).",
            hint="use for example `--good 0.05 --bad 0.5`",
        )
    test = SequentialTest(good, bad, ERROR)
    return SequentialTest(good, bad, ERROR, most=max(MOST, 2 * test.shortest(False)))


def _lines(found: Minimised, folder: Path, budget: int) -> Iterator[str]:
    yield ""
    best, run = found.best, found.request.run.partition("/")[2]
    if best is None:
        yield f"{run}: inconclusive whether it fails again."
    elif best.changes:
        runs = f"{best.judged.failed} of {best.judged.runs} runs"
        interval = interval_text(anytime(best.judged.failed, best.judged.runs))
        yield f"{run} still fails, in {runs} (95 % interval {interval}): {best.judged.reason}"
        yield format_table(
            ["PARAMETER", "NOW", "WAS", "LEAST EXTREME TRIED"], _rows(found)
        ).rstrip()
    else:
        yield f"{run}: no less extreme values were found that fail."
    if found.end is not End.MINIMAL:
        ended = "Interrupted" if found.end is End.INTERRUPTED else "The budget is used up"
        more = [] if found.end is End.INTERRUPTED else [f"--budget={2 * budget}"]
        command = ["minimise", str(folder), f"--resume={shown(found.campaign)}", *more]
        yield f"{ended}; less extreme values may exist. Continue: {as_shell(command)}"
    if best is not None:
        yield f"Reproduce: {as_shell(['replay', str(shown(found.campaign / best.example))])}"
    yield f"Steps: {shown(found.campaign / 'minimise.json')}"


def _rows(found: Minimised) -> Iterator[list[str]]:
    """Yield the result of each reduction."""
    first, best = found.steps[0].parameters, found.best
    assert best is not None  # noqa: S101
    for reduction in found.request.reductions:
        name = reduction.parameter
        was, now = shown_value(first[name]), shown_value(best.parameters[name])
        least = shown_value(_least_extreme(reduction, found.steps))
        tried = "none" if least == was else str(least)
        if isinstance(reduction, Items):
            yield [name, f"{now} of {was} items", "", f"{tried} items"]
        else:
            yield [name, str(now), "" if was == now else str(was), tried]


def _least_extreme(reduction: Items | Ladder, steps: Sequence[MinimiseStep]) -> Any:
    """Return the least extreme value of a parameter that was tried."""
    tried = (step.parameters[reduction.parameter] for step in steps)
    return min(tried, key=len if isinstance(reduction, Items) else reduction.values.index)
