"""`vast exec local`: campaigns on this machine."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast_cli.lazy import examples, exit_codes
from robovast_cli.ui.usage import UsageError

Select = Annotated[
    list[str] | None,
    typer.Option(
        "-c",
        "--config",
        metavar="NAME|GLOB",
        help="Select configurations by name, entry or glob, or shard N of M with `N/M` "
        "(repeatable).",
    ),
]
Runs = Annotated[
    int | None,
    typer.Option("-r", "--runs", min=1, help="Runs per configuration (default: `execution.runs`)."),
]
Limits = Annotated[
    bool,
    typer.Option(
        "--use-resource-allocation",
        help="Limit CPU and memory of containers to the values in the .vast file.",
    ),
]
LogTree = Annotated[
    bool, typer.Option("-t", "--log-tree", help="Log the live behavior tree of the scenario.")
]
Debug = Annotated[
    bool, typer.Option("-d", "--debug", help="Write the debug log of scenario-execution.")
]


@exit_codes(
    "0 all passed · 1 a run failed · 2 invalid input · 3 cannot run · 4 a run "
    "errored or was not started, none failed · 5 cannot write results · 130 interrupted"
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
            metavar="OUT", help="Results folder (default: from the project, else `results`)."
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PATH", help="Same as OUT.")
    ] = None,
    config: Select = None,
    runs: Runs = None,
    batches: Annotated[
        int | None,
        typer.Option(
            "--batches",
            min=1,
            help="For a search: stop after N batches in total, regardless of the .vast file. With "
            "`--resume`, extend a finished search.",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "-j",
            "--jobs",
            min=1,
            help="Number of parallel jobs (default: available CPUs / CPUs per run).",
        ),
    ] = None,
    runtime: Annotated[
        Literal["docker", "podman", "process", "auto"],
        typer.Option(
            "--runtime", help="Runtime; `auto` selects and reports the first available one."
        ),
    ] = "auto",
    image: Annotated[
        str | None,
        typer.Option(
            "-i",
            "--image",
            help="Container image (default: $ROBOVAST_IMAGE, else `execution.image`).",
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            "--resume",
            metavar="CAMPAIGN_DIR",
            help="Resume this campaign without repeating finished runs. With `--runs N`, extend "
            "to N runs in total, only for the `--config` selection if given.",
        ),
    ] = None,
    reuse: Annotated[
        bool,
        typer.Option(
            "--reuse",
            help="Reuse runs with identical inputs and seed from other campaigns in the results "
            "folder. Requires `execution.seed`.",
        ),
    ] = False,
    abort_on_failure: Annotated[
        bool,
        typer.Option(
            "--abort-on-failure", help="Start no more runs after the first unsuccessful run."
        ),
    ] = False,
    start_only: Annotated[
        bool,
        typer.Option(
            "--start-only",
            help="Open a shell in the container of the first run, without running it.",
        ),
    ] = False,
    gui: Annotated[
        bool | None,
        typer.Option(
            "--gui/--no-gui",
            help="Show windows if a display is available (default: --gui, but --no-gui for "
            "imported campaigns).",
        ),
    ] = None,
    network_host: Annotated[
        bool, typer.Option("--network-host", help="Use the network of this machine in containers.")
    ] = False,
    use_resource_allocation: Limits = False,
    log_tree: LogTree = False,
    debug: Debug = False,
) -> int:
    """Run a campaign on this machine.

    Uses Docker or Podman if available and an image is set, otherwise local processes.
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
    campaign.reject_vast_file(out or output)
    if start_only:
        from robovast.execution.local import open_shell

        return open_shell(ctx.obj.document(), options)
    if resume is not None:
        if out or output:
            message = "`--resume` stores results in the campaign"
            raise UsageError(message, ctx, hint="remove OUT and `--output`")
        return campaign.resume(resume, options)
    if out and output and out != output:
        message = f"OUT ({out}) and --output ({output}) differ"
        raise UsageError(message, ctx, hint="use one of them")
    document = ctx.obj.document()
    if out and not (output or config):
        options = campaign.resolve_selection(document, out, options)
        out = None if options.select else out
    return campaign.start(document, out or output or ctx.obj.results, options)


@examples(
    ("vast exec local prepare-run manual -c hall-1", "Prepare one configuration"),
    ("vast exec local prepare-run manual -c 'hall-*' --runs 2", "Prepare a selection, 2 runs each"),
)
def prepare_run(
    ctx: typer.Context,
    out: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="New folder, or a folder of an earlier `prepare-run`."),
    ],
    config: Select = None,
    runs: Runs = None,
    use_resource_allocation: Limits = False,
    log_tree: LogTree = False,
    debug: Debug = False,
) -> None:
    """Write a folder with a `run.sh` that runs Docker Compose by hand."""
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
    typer.echo(f"Run {script}. `{script} --help` lists its options.")
