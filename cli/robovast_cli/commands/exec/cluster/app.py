"""`vast exec cluster`: campaigns on a Kubernetes cluster."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from robovast_cli.commands.exec.local import Debug, LogTree, Runs, Select
from robovast_cli.kube.options import (
    CampaignName,
    Context,
    Namespace,
    SetupOptions,
    setup_config,
)
from robovast_cli.lazy import new_app

Image = Annotated[
    str | None,
    typer.Option(
        "--image",
        envvar="ROBOVAST_IMAGE",
        show_envvar=False,
        help="Container image; $ROBOVAST_IMAGE, then the file's, when omitted.",
        show_default=False,
    ),
]
ConfigOption = Annotated[
    list[str] | None,
    typer.Option(
        "-o",
        "--option",
        metavar="KEY=VALUE",
        help="Option of the cluster configuration, or value of the chart as "
        "`operator.replicas=2`; may be repeated.",
        show_default=False,
    ),
]

RunWords = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[CAMPAIGN] RUN",
        help="The run by its folder, as `hall-1/0`; its campaign where there are several.",
        show_default=False,
    ),
]
CampaignWord = Annotated[
    str | None,
    typer.Argument(
        metavar="CAMPAIGN",
        help="The campaign, where there are several.",
        show_default=False,
    ),
]
Secondary = Annotated[
    str | None,
    typer.Option(
        "--secondary",
        metavar="NAME",
        help="The secondary container of this name; the main one when omitted.",
        show_default=False,
    ),
]

app = new_app("Run on a Kubernetes cluster.", no_args_is_help=True)


@app.callback()
def cluster() -> None:
    """Run on a Kubernetes cluster."""


@app.command()
def run(
    ctx: typer.Context,
    config: Select = None,
    runs: Runs = None,
    image: Image = None,
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
    reuse: Annotated[
        bool,
        typer.Option(
            "--reuse",
            help="Take over runs that another campaign with this option has stored with equal "
            "inputs and seed. The file must set `execution.seed`, and the image have a digest.",
        ),
    ] = False,
    queue: Annotated[
        str | None,
        typer.Option(
            "--queue",
            metavar="NAME",
            help="Kueue LocalQueue that admits the campaign; `robovast`, if there, when omitted.",
            show_default=False,
        ),
    ] = None,
    queue_priority: Annotated[
        str | None,
        typer.Option(
            "--queue-priority",
            metavar="NAME",
            help="Kueue WorkloadPriorityClass: what is higher comes first in the queue.",
            show_default=False,
        ),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Print the Campaign, for Git or kubectl; create nothing."),
    ] = False,
    estimate: Annotated[
        bool,
        typer.Option(
            "--estimate",
            help="Print how long it would take and cost, by earlier campaigns of the file; "
            "create nothing.",
        ),
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
    ended without a verdict, none failed; 130: no longer followed. docs/reference/exit-codes.md
    lists all.
    """
    from robovast.kubeapi.submission import SubmitOptions
    from robovast_cli.commands.exec.cluster import run as cluster_run

    options = SubmitOptions(
        select=config,
        runs=runs,
        image=image,
        log_tree=log_tree,
        debug=debug,
        context=context,
        queue=queue,
        queue_priority=queue_priority,
        parallelism=parallelism,
        reuse=reuse,
    )
    document = ctx.obj.document()
    if dry_run:
        return cluster_run.print_campaign(document, options, namespace, output)
    if estimate:
        from robovast_cli.commands.exec.cluster.estimating import print_estimate

        print_estimate(document, options, context, namespace)
        return 0
    return cluster_run.run(
        document, options, context, namespace, detach=detach, clean_before=cleanup
    )


@app.command()
def monitor(
    interval: Annotated[
        float, typer.Option("-i", "--interval", min=0.2, help="Time between two looks [s].")
    ] = 2.0,
    once: Annotated[bool, typer.Option("--once", help="Print a table of all, and end.")] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Show the progress of campaigns until none runs any more; Ctrl-C ends only the showing."""
    from robovast_cli.commands.exec.cluster import monitor as cluster_monitor

    cluster_monitor.monitor(context, namespace, interval=interval, once=once)


@app.command()
def logs(
    words: RunWords = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Wait for the run, print what comes.")
    ] = False,
    secondary: Secondary = None,
    tail: Annotated[
        int | None,
        typer.Option(
            "--tail", metavar="N", min=0, help="Only the last N lines.", show_default=False
        ),
    ] = None,
    failed: Annotated[
        bool, typer.Option("--failed", help="The logs of all failed and errored runs, in turn.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Print the log of a run, whether it runs or is stored; say why it waits.

    Where several runs share a pod, it is that run's part of the log.
    """
    from robovast_cli.commands.exec.cluster import logs as cluster_logs

    how = cluster_logs.How(follow, secondary, tail)
    cluster_logs.logs(context, namespace, words or [], how, failed=failed)


@app.command()
def runs(
    campaign: CampaignWord = None,
    failed: Annotated[
        bool, typer.Option("--failed", help="Only those that failed or errored.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Print which runs are executed now and by which pod, and which did not pass and why."""
    from robovast_cli.commands.exec.cluster import runs as cluster_runs

    cluster_runs.runs(context, namespace, campaign, failed=failed)


@app.command()
def shell(
    words: RunWords = None,
    secondary: Secondary = None,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Open a shell in the container of a run that is executed; needs kubectl."""
    from robovast_cli.commands.exec.cluster import shell as cluster_shell

    return cluster_shell.shell(context, namespace, words or [], secondary)


@app.command("debug")
def debug_run(words: RunWords = None, context: Context = None, namespace: Namespace = None) -> None:
    """Execute a run once more in a pod of its own that stays, to look into it.

    With its parameters, seed and image; nothing of it is stored in the campaign's results.
    """
    from robovast_cli.commands.exec.cluster import debug as cluster_debug

    cluster_debug.debug(context, namespace, words or [])


@app.command()
def setup(
    cluster_config: Annotated[
        str | None,
        typer.Argument(
            metavar="CLUSTER_CONFIG", help="Kind of cluster, as `gcp`.", show_default=False
        ),
    ] = None,
    list_: Annotated[
        bool, typer.Option("--list", help="List the cluster configurations, and end.")
    ] = False,
    option: ConfigOption = None,
    force: Annotated[
        bool,
        typer.Option(
            "-f", "--force", help="Also when another cluster configuration was used before."
        ),
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Install RoboVAST in the cluster, or renew it; needs Helm."""
    from robovast_cli.commands.exec.cluster import setup as cluster_setup

    if list_ or cluster_config is None:
        return cluster_setup.list_configs()
    return cluster_setup.setup(cluster_config, option or [], context, namespace, force=force)


@app.command()
def cleanup(
    force: Annotated[bool, typer.Option("-f", "--force", help="Also while campaigns run.")] = False,
    _config: Annotated[str | None, setup_config("c")] = None,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Remove RoboVAST from the cluster; needs Helm."""
    from robovast_cli.commands.exec.cluster import setup as cluster_setup

    cluster_setup.cleanup(context, namespace, force=force)


@app.command()
def prepare_setup(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="New or empty folder.")],
    cluster_config: Annotated[
        str,
        typer.Option("--cluster-config", metavar="NAME", help="Kind of cluster, as `gcp`."),
    ],
    option: ConfigOption = None,
    namespace: Annotated[
        str, typer.Option("-n", "--namespace", metavar="NAME", help="Where it will be installed.")
    ] = "default",
) -> None:
    """Write the chart, its values and instructions, to set a cluster up by hand."""
    from robovast_cli.commands.exec.cluster import setup as cluster_setup

    cluster_setup.prepare_setup(cluster_config, option or [], out, namespace)


@app.command()
def prepare_run(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="DIR", help="New or empty folder.")],
    config: Select = None,
    runs: Runs = None,
    image: Image = None,
    log_tree: LogTree = False,
    debug: Debug = False,
    _cluster_config: Annotated[str | None, setup_config("k")] = None,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Write the Campaign, and instructions, to run it with kubectl."""
    from robovast.kubeapi.submission import SubmitOptions
    from robovast_cli.commands.exec.cluster import prepare as cluster_prepare

    options = SubmitOptions(config, runs, image, log_tree, debug, context)
    cluster_prepare.prepare_run(ctx.obj.document(), options, namespace, out)


@app.command()
def stop(
    campaign: CampaignName = None, context: Context = None, namespace: Namespace = None
) -> None:
    """Stop a campaign: its pods end, stored runs are kept, and it can be resumed.

    Runs in progress are not stored; they are executed again after `resume`.
    """
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.stop(context, namespace, campaign)


@app.command()
def resume(
    campaign: CampaignName = None,
    batches: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Let a search go on, even one that has ended: it ends after so many batches in "
            "all, whatever its `budget` and `stopping` say.",
        ),
    ] = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Let a stopped campaign go on after its last stored run."""
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.resume(context, namespace, campaign, batches)


@app.command()
def retry(
    campaign: CampaignName = None, context: Context = None, namespace: Namespace = None
) -> None:
    """Execute the failed and errored runs of a finished campaign once more."""
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.retry(context, namespace, campaign)


@app.command()
def run_cleanup(
    campaign: CampaignName = None,
    data: Annotated[
        bool, typer.Option("--data", help="Also remove its results from the cluster's storage.")
    ] = False,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Remove finished campaigns, or the one that is named, from the cluster; results stay."""
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.run_cleanup(context, namespace, campaign, data=data)


@app.command()
def download_cleanup(
    campaign: CampaignName = None,
    yes: Annotated[bool, typer.Option("-y", "--yes", help="Do not ask.")] = False,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Remove the results of finished campaigns from the cluster's storage."""
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.download_cleanup(context, namespace, campaign, ask=not yes)


@app.command()
def upload_to_share(
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="Only this campaign: its name, or that of its results folder. May be repeated; "
            "all finished campaigns of the namespace when omitted.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace existing archives on the share.")
    ] = False,
    detach: Annotated[
        bool, typer.Option("--detach", help="Return as soon as the cluster has begun.")
    ] = False,
    image: Annotated[
        str | None,
        typer.Option(
            "--image",
            help="Image of RoboVAST's agent, as one with a share provider of your own; that of "
            "the campaigns' Jobs when omitted.",
            show_default=False,
        ),
    ] = None,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Upload results of finished campaigns from the cluster to the share.

    The cluster does it; Ctrl-C only ends the following. The share is described by
    ROBOVAST_SHARE_TYPE and the variables of its kind, in the environment or a `.env` file in this
    folder or above; docs/how-to/publish.md lists them. Existing archives are kept.
    """
    from robovast_cli.commands.exec.cluster.share import How, upload_to_share

    return upload_to_share(context, namespace, campaign or [], How(force, detach, image))
