"""`vast minimise`: fewer and milder parameters with which a run still fails."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast_cli.commands.replay import Image, Out, Runtime, brought_here
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import new_app

app = new_app("Find the fewest list items and the mildest values with which a run still fails.")


@app.command()
def minimise(
    run: Annotated[
        Path,
        typer.Argument(
            metavar="RUN",
            help="A run that failed, `<campaign>/<configuration>/<run>`: its folder or, without "
            "one, its name in the cluster's storage.",
        ),
    ],
    budget: Annotated[
        int,
        typer.Option(
            "--budget", min=1, metavar="RUNS", help="Executed runs after which no step begins."
        ),
    ] = 200,
    good: Annotated[
        float,
        typer.Option(help="What fails in at most this share of its runs does not fail any more."),
    ] = 0.1,
    bad: Annotated[
        float, typer.Option(help="What fails in at least this share of its runs still fails.")
    ] = 0.5,
    out: Out = Path("minimised"),
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Folder of an earlier `vast minimise` of this run, to continue it.",
            show_default=False,
        ),
    ] = None,
    runtime: Runtime = "same",
    image: Image = None,
    jobs: Annotated[int, typer.Option("-j", "--jobs", min=1, help="Runs side by side.")] = 1,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Find the fewest list items and the mildest values with which a run still fails.

    Mild is what configurations of the campaign have that pass, else the scenario's default. Each
    step is run until a sequential test says whether it still fails, for the same cause. The run
    stays as it is. Exit code 0: found, or the budget is used up; 130: interrupted.

    Example: vast minimise results/hall-2026-03-04-152130/hall-1/0 --budget 100
    """
    from robovast_cli.ui.minimise import minimised

    run = brought_here(run, out, context, namespace)
    return minimised(run, out, resume, budget, (good, bad), runtime=runtime, image=image, jobs=jobs)
