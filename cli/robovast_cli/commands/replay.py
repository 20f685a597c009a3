"""`vast replay`: execute a stored run again, and compare."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast.base.errors import InputError
from robovast.model.naming import is_run_number
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import new_app

Runtime = Annotated[
    Literal["same", "docker", "podman", "process"],
    typer.Option("--runtime", help="What executes it; the same as then when omitted."),
]
Image = Annotated[
    str | None,
    typer.Option(
        "--image",
        help="Container image, in place of the one that ran.",
        show_default=False,
    ),
]
Out = Annotated[
    Path, typer.Option("--out", metavar="PATH", help="Folder for the new campaign's folder.")
]

app = new_app("Execute a run again, with its files, parameters, seed and image, and compare.")


@app.command()
def replay(
    run: Annotated[
        Path,
        typer.Argument(
            metavar="RUN",
            help="`<campaign>/<configuration>/<run>`: its folder or, without one, its name in the "
            "cluster's storage.",
        ),
    ],
    times: Annotated[
        int,
        typer.Option(
            "--times",
            min=1,
            max=100_000,
            help="How often; with 2 or more, also say whether the harness is flaky.",
        ),
    ] = 1,
    out: Out = Path("replays"),
    compare: Annotated[
        list[str] | None,
        typer.Option(
            "--compare",
            metavar="GLOB",
            help="Output to compare, in place of the document's; may be repeated.",
            show_default=False,
        ),
    ] = None,
    runtime: Runtime = "same",
    image: Image = None,
    jobs: Annotated[
        int,
        typer.Option("-j", "--jobs", min=1, help="Replays side by side."),
    ] = 1,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Execute a run again, with its files, parameters, seed and image, and compare.

    The run stays as it is. Verdict and outputs are compared: those that `execution.compare` names,
    else all CSV files that the run wrote. Exit code 0: all replays had the run's result; 1: one
    had another; 130: interrupted.

    Example: vast replay results/hall-2026-03-04-152130/hall-1/0 --times 10
    """
    from robovast_cli.ui.replay import replayed

    run = brought_here(run, out, context, namespace)
    return replayed(run, out, times, compare, runtime=runtime, image=image, jobs=jobs)


def brought_here(run: Path, out: Path, context: str | None, namespace: str | None) -> Path:
    """The folder of a run, fetched below `out` if only a cluster has it."""
    if not is_stored_elsewhere(run):
        if context or namespace:
            option = "`--context`" if context else "`-n` (`--namespace`)"
            count = namespace if namespace and namespace.isdecimal() else None
            times = f" For {count} replays: `vast replay --times {count}`." if count else ""
            raise InputError(
                f"{run} is on this machine, but {option} chooses a run of a cluster. "
                f"Remove {option}.{times}"
            )
        return run
    from robovast.base.optional_deps import CLUSTER

    with CLUSTER.needed_by("Access to a cluster"):
        from robovast_cli.commands.results.downloading import download_run

    return download_run(context, namespace, str(run), out / "originals")


def is_stored_elsewhere(run: Path) -> bool:
    """Whether a run is not on this machine, but may be on a cluster."""
    here = run.is_absolute() or run.parent.parent.exists()
    return not here and len(run.parts) == 3 and is_run_number(run.name)
