"""`vast exec local`: campaigns on this machine."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast_cli.lazy import examples, new_app

app = new_app("Run on this machine: in Docker, in Podman or as plain processes.")

Select = Annotated[
    list[str] | None,
    typer.Option(
        "-c",
        "--config",
        metavar="NAME|GLOB",
        help="Only these: a configuration, an entry, or a glob; `N/M`, of these the N-th of M "
        "parts. May be repeated.",
        show_default=False,
    ),
]
Runs = Annotated[
    int | None,
    typer.Option(
        "-r",
        "--runs",
        min=1,
        help="Runs of each configuration; the file's `execution.runs` when omitted.",
        show_default=False,
    ),
]
Limits = Annotated[
    bool,
    typer.Option(
        "--use-resource-allocation",
        help="Limit CPU and memory of the containers to what the file asks for.",
    ),
]
LogTree = Annotated[
    bool, typer.Option("-t", "--log-tree", help="Log the live behaviour tree of the scenario.")
]
Debug = Annotated[bool, typer.Option("-d", "--debug", help="Debug log of scenario-execution.")]


@app.callback()
def local() -> None:
    """Run on this machine: in Docker, in Podman or as plain processes."""


@app.command(
    epilog="Exit codes: 0 all passed · 1 a run failed · 2 invalid input · 4 a run errored · "
    "130 interrupted"
)
@examples(
    ("vast exec local run", "Run all configurations"),
    ("vast exec local run -c 'hall-*' --runs 5", "Run a selection, 5 times each"),
    ("vast exec local run --resume results/hall-2026-03-04-152130", "Resume a campaign"),
)
def run(
    ctx: typer.Context,
    out: Annotated[
        Path | None,
        typer.Argument(
            metavar="OUT",
            help="Folder for the campaign's folder; the project's results folder when omitted.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="PATH", help="The same as OUT.", show_default=False),
    ] = None,
    config: Select = None,
    runs: Runs = None,
    batches: Annotated[
        int | None,
        typer.Option(
            "--batches",
            min=1,
            help="Of a search: end it after so many batches in all, whatever the file says. With "
            "`--resume` one that has ended goes on.",
            show_default=False,
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "-j",
            "--jobs",
            min=1,
            help="Jobs side by side; as many as the CPUs allow that a run asks for when omitted.",
            show_default=False,
        ),
    ] = None,
    runtime: Annotated[
        Literal["docker", "podman", "process", "auto"],
        typer.Option(
            "--runtime",
            help="What executes a run; `auto` chooses the first one available and reports it.",
        ),
    ] = "auto",
    image: Annotated[
        str | None,
        typer.Option(
            "-i",
            "--image",
            help="Container image; $ROBOVAST_IMAGE, then the file's, when omitted.",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            "--resume",
            metavar="CAMPAIGN_DIR",
            help="Continue this campaign: finished runs are not repeated. More `--runs` are in "
            "all, of those of `--config` alone if it is given.",
            show_default=False,
        ),
    ] = None,
    reuse: Annotated[
        bool,
        typer.Option(
            "--reuse",
            help="Take over runs that another campaign of the same results folder has executed "
            "with equal inputs and seed. The file must set `execution.seed`.",
        ),
    ] = False,
    abort_on_failure: Annotated[
        bool,
        typer.Option(
            "--abort-on-failure", help="Start nothing more after a run that does not pass."
        ),
    ] = False,
    start_only: Annotated[
        bool,
        typer.Option(
            "--start-only", help="Open a shell in the first run's container instead of running it."
        ),
    ] = False,
    gui: Annotated[
        bool | None,
        typer.Option(
            "--gui/--no-gui",
            help="Show windows if there is a display (default: unless the campaign was imported).",
        ),
    ] = None,
    network_host: Annotated[
        bool, typer.Option("--network-host", help="Use the network of this machine.")
    ] = False,
    use_resource_allocation: Limits = False,
    log_tree: LogTree = False,
    debug: Debug = False,
) -> int:
    """Run a campaign, or continue one, and say how it ended.

    Exit code 0: every run passed; 1: a test failed; 4: a run ended without a verdict, none
    failed; 130: interrupted. docs/reference/exit-codes.md lists all.
    """
    from robovast.execution.local.events import LocalOptions
    from robovast_cli.ui import campaign

    options = LocalOptions(
        select=config,
        runs=runs,
        batches=batches,
        jobs=jobs,
        runtime=runtime,
        image=image,
        gui=gui,
        network_host=network_host,
        reuse=reuse,
        abort_on_failure=abort_on_failure,
        enforce_resources=use_resource_allocation,
        log_tree=log_tree,
        debug=debug,
    )
    campaign.refuse_document(out or output)
    if start_only:
        from robovast.execution.local import open_shell

        return open_shell(ctx.obj.document(), options)
    if resume is not None:
        if out or output:
            raise typer.BadParameter("the results go to the campaign; name no OUT.", ctx)
        return campaign.resume(resume, options)
    if out and output and out != output:
        raise typer.BadParameter(f"OUT is {out}, and --output is {output}; name one.", ctx)
    document = ctx.obj.document()
    if out and not (output or config):
        options = campaign.meant(document, out, options)
        out = None if options.select else out
    return campaign.start(document, out or output or ctx.obj.results, options)


@app.command()
def prepare_run(
    ctx: typer.Context,
    out: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="New folder, or one that an earlier `prepare-run` has written."
        ),
    ],
    config: Select = None,
    runs: Runs = None,
    use_resource_allocation: Limits = False,
    log_tree: LogTree = False,
    debug: Debug = False,
) -> None:
    """Write a folder with a `run.sh` for Docker Compose."""
    from robovast.execution.local import LocalOptions, prepare_run
    from robovast_cli.workspace import shown

    options = LocalOptions(
        select=config,
        runs=runs,
        enforce_resources=use_resource_allocation,
        log_tree=log_tree,
        debug=debug,
    )
    script = shown(prepare_run(ctx.obj.document(), out, options))
    typer.echo(f"Run it with {script}; `{script} --help` tells more.")
