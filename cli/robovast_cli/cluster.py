"""`vast exec cluster`: campaigns on a Kubernetes cluster."""

from typing import Annotated, Literal

import typer

from robovast_cli.cluster_options import Context, Namespace
from robovast_cli.lazy import new_app
from robovast_cli.local import Debug, LogTree, Runs, Select

app = new_app("Run on a Kubernetes cluster.", no_args_is_help=True)


@app.callback()
def cluster() -> None:
    """Run on a Kubernetes cluster."""


@app.command()
def run(
    ctx: typer.Context,
    config: Select = None,
    runs: Runs = None,
    image: Annotated[
        str | None,
        typer.Option(
            "-i", "--image", help="Container image; the file's when omitted.", show_default=False
        ),
    ] = None,
    detach: Annotated[
        bool, typer.Option("--detach", help="Return as soon as the cluster has the campaign.")
    ] = False,
    cleanup: Annotated[
        bool, typer.Option("--cleanup", help="Remove finished campaigns before; results stay.")
    ] = False,
    parallelism: Annotated[
        int | None,
        typer.Option(
            "--parallelism",
            min=1,
            help="Most pods at once; 100 when omitted.",
            show_default=False,
        ),
    ] = None,
    queue: Annotated[
        str | None,
        typer.Option(
            "--queue",
            metavar="NAME",
            help="Kueue LocalQueue that admits the campaign.",
            show_default=False,
        ),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Print the Campaign, for Git or kubectl; create nothing."),
    ] = False,
    output: Annotated[
        Literal["yaml", "json"], typer.Option("-o", "--output", help="How `--dry-run` prints it.")
    ] = "yaml",
    log_tree: LogTree = False,
    debug: Debug = False,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Run a campaign on the cluster, follow it to its end, and say how it ended.

    Ctrl-C only ends the following. Exit code 0: every run passed; 1: a test failed; 4: a run
    ended without a verdict, none failed; 130: no longer followed. `docs/cli.md` lists all.
    """
    from robovast.cluster.submission import SubmitOptions
    from robovast_cli import cluster_run

    options = SubmitOptions(
        select=config,
        runs=runs,
        image=image,
        log_tree=log_tree,
        debug=debug,
        context=context,
        queue=queue,
        parallelism=parallelism,
    )
    document = ctx.obj.document()
    if dry_run:
        return cluster_run.print_campaign(document, options, namespace, output)
    return cluster_run.run(
        document, options, context, namespace, detach=detach, clean_before=cleanup
    )


@app.command()
def monitor(
    interval: Annotated[
        float, typer.Option("-i", "--interval", min=0.2, help="Time between two looks [s].")
    ] = 2.0,
    once: Annotated[bool, typer.Option("--once", help="Look once, and print a table.")] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Show the progress of all campaigns until none is left that runs; Ctrl-C ends it before."""
    from robovast_cli import cluster_monitor

    cluster_monitor.monitor(context, namespace, interval=interval, once=once)
