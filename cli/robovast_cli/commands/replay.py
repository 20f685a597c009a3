"""`vast replay`: run a stored run again and compare the results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast.base.errors import InputError
from robovast.model.naming import is_run_number
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import examples, exit_codes

Runtime = Annotated[
    Literal["same", "docker", "podman", "process"],
    typer.Option("--runtime", help="Runtime; `same` is the runtime of the stored run."),
]
Image = Annotated[
    str | None,
    typer.Option(
        "--image",
        help="Container image (default: the image of the stored run).",
        show_default=False,
    ),
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
            show_default=False,
        ),
    ] = None,
    runtime: Runtime = "same",
    image: Image = None,
    jobs: Annotated[
        int,
        typer.Option("-j", "--jobs", min=1, help="Number of re-runs in parallel."),
    ] = 1,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Run a stored run again and compare the results.

    Uses the files, parameters, seed and image of the stored run, and compares verdict and outputs.
    The stored run is not modified.
    """
    from robovast_cli.ui.replay import replayed

    run = brought_here(run, out, context, namespace)
    return replayed(run, out, times, compare, runtime=runtime, image=image, jobs=jobs)


def brought_here(run: Path, out: Path, context: str | None, namespace: str | None) -> Path:
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
