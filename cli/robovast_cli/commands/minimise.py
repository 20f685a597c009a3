"""`vast minimise`: reduce the parameters of a failed run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.replay import Image, Out, Runtime, brought_here
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import examples, exit_codes


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
        float,
        typer.Option(metavar="RATE", help="Highest failure rate of a passing step."),
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
            show_default=False,
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
    from robovast_cli.ui.minimise import minimised

    run = brought_here(run, out, context, namespace)
    return minimised(run, out, resume, budget, (good, bad), runtime=runtime, image=image, jobs=jobs)
