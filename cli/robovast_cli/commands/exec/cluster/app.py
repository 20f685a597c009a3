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
from robovast_cli.lazy import examples, new_app

Image = Annotated[
    str | None,
    typer.Option(
        "--image",
        envvar="ROBOVAST_IMAGE",
        show_envvar=False,
        help="Container image (default: $ROBOVAST_IMAGE, else `execution.image`).",
        show_default=False,
    ),
]
ConfigOption = Annotated[
    list[str] | None,
    typer.Option(
        "-o",
        "--option",
        metavar="KEY=VALUE",
        help="Option of the cluster configuration, or value of the chart such as "
        "`operator.replicas=2` (repeatable).",
        show_default=False,
    ),
]

RunWords = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[CAMPAIGN] RUN",
        help="Run, for example `hall-1/0`. Add CAMPAIGN if the namespace has several campaigns.",
        show_default=False,
    ),
]
CampaignWord = Annotated[
    str | None,
    typer.Argument(
        metavar="CAMPAIGN",
        help="Campaign, required if the namespace has several.",
        show_default=False,
    ),
]
Secondary = Annotated[
    str | None,
    typer.Option(
        "--secondary",
        metavar="NAME",
        help="Secondary container (default: the main container).",
        show_default=False,
    ),
]

app = new_app("Run campaigns on a Kubernetes cluster.", no_args_is_help=True)


@app.callback()
def cluster() -> None:
    """Run campaigns on a Kubernetes cluster."""


@app.command(
    epilog="Exit codes: 0 all passed · 1 a run failed · 2 invalid input · 3 cannot run · 4 a run "
    "errored or was not started, none failed · 130 display interrupted"
)
@examples(
    ("vast exec cluster run", "Run all configurations and wait"),
    ("vast exec cluster run -c 'hall-*' --runs 5 --detach", "Submit a selection and exit"),
    ("vast exec cluster run --dry-run > campaign.yaml", "Write the Campaign for Git"),
)
def run(
    ctx: typer.Context,
    config: Select = None,
    runs: Runs = None,
    image: Image = None,
    detach: Annotated[bool, typer.Option("--detach", help="Submit the campaign and exit.")] = False,
    cleanup: Annotated[
        bool,
        typer.Option("--cleanup", help="First delete finished campaigns, but keep their results."),
    ] = False,
    parallelism: Annotated[
        int | None,
        typer.Option(
            "--parallelism",
            min=1,
            help="Maximum number of concurrent pods (default: 100).",
            show_default=False,
        ),
    ] = None,
    reuse: Annotated[
        bool,
        typer.Option(
            "--reuse",
            help="Reuse runs with identical inputs and seed from other campaigns with this "
            "option. Requires `execution.seed` and an image digest.",
        ),
    ] = False,
    queue: Annotated[
        str | None,
        typer.Option(
            "--queue",
            metavar="NAME",
            help="Kueue LocalQueue of the campaign (default: `robovast`, if it exists).",
            show_default=False,
        ),
    ] = None,
    queue_priority: Annotated[
        str | None,
        typer.Option(
            "--queue-priority",
            metavar="NAME",
            help="Kueue WorkloadPriorityClass; higher priorities are admitted first.",
            show_default=False,
        ),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Print the Campaign for Git or kubectl, without creating it."
        ),
    ] = False,
    estimate: Annotated[
        bool,
        typer.Option(
            "--estimate",
            help="Print the estimated duration and cost, based on earlier campaigns of the .vast "
            "file, without creating the campaign.",
        ),
    ] = False,
    output: Annotated[
        Literal["yaml", "json"],
        typer.Option("-o", "--output", help="Output format of `--dry-run`."),
    ] = "yaml",
    log_tree: LogTree = False,
    debug: Debug = False,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Run a campaign on the cluster and wait until it completes.

    Ctrl-C stops the display, not the campaign.
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
@examples(
    ("vast exec cluster monitor", "Watch until no campaign is running"),
    ("vast exec cluster monitor --once -n lab", "Print one snapshot of the namespace lab"),
)
def monitor(
    interval: Annotated[
        float, typer.Option("-i", "--interval", min=0.2, help="Refresh interval in seconds.")
    ] = 2.0,
    once: Annotated[
        bool, typer.Option("--once", help="Print one snapshot of all campaigns and exit.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Watch running campaigns.

    Exits when no campaign is running. Ctrl-C stops the display, not the campaigns.
    """
    from robovast_cli.commands.exec.cluster import monitor as cluster_monitor

    cluster_monitor.monitor(context, namespace, interval=interval, once=once)


@app.command()
@examples(
    ("vast exec cluster logs hall-1/0 --follow", "Stream the log of a run"),
    ("vast exec cluster logs hall-x7k2p hall-1/0 --tail 50", "Name the campaign, print 50 lines"),
    ("vast exec cluster logs --failed", "Print the logs of all unsuccessful runs"),
)
def logs(
    words: RunWords = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Wait for the run to start and stream its log.")
    ] = False,
    secondary: Secondary = None,
    tail: Annotated[
        int | None,
        typer.Option(
            "--tail", metavar="N", min=0, help="Print only the last N lines.", show_default=False
        ),
    ] = None,
    failed: Annotated[
        bool, typer.Option("--failed", help="Print the logs of all failed and errored runs.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Print the log of a running or stored run.

    If the run is pending, prints the reason for waiting. If several runs share a pod, prints only
    the part of this run.
    """
    from robovast_cli.commands.exec.cluster import logs as cluster_logs

    how = cluster_logs.How(follow, secondary, tail)
    cluster_logs.logs(context, namespace, words or [], how, failed=failed)


@app.command()
@examples(
    ("vast exec cluster runs", "List the runs of the only campaign"),
    ("vast exec cluster runs hall-x7k2p --failed", "List failed and errored runs"),
)
def runs(
    campaign: CampaignWord = None,
    failed: Annotated[
        bool, typer.Option("--failed", help="List only failed and errored runs.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """List the running and the unsuccessful runs of a campaign.

    Shows the pod of each running run, and the reason of each failed or errored run.
    """
    from robovast_cli.commands.exec.cluster import runs as cluster_runs

    cluster_runs.runs(context, namespace, campaign, failed=failed)


@app.command()
@examples(
    ("vast exec cluster shell hall-1/0", "Open a shell in the main container"),
    ("vast exec cluster shell hall-1/0 --secondary simulator", "Open one in another container"),
)
def shell(
    words: RunWords = None,
    secondary: Secondary = None,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Open a shell in the container of a running run (requires kubectl)."""
    from robovast_cli.commands.exec.cluster import shell as cluster_shell

    return cluster_shell.shell(context, namespace, words or [], secondary)


@app.command("debug")
@examples(
    ("vast exec cluster debug hall-1/0", "Run a run of the only campaign again"),
    ("vast exec cluster debug hall-x7k2p hall-1/0", "Name the campaign"),
)
def debug_run(words: RunWords = None, context: Context = None, namespace: Namespace = None) -> None:
    """Run a run again in a separate pod, and keep the pod for inspection.

    Uses the parameters, seed and image of the run. The results of the campaign do not change.
    """
    from robovast_cli.commands.exec.cluster import debug as cluster_debug

    cluster_debug.debug(context, namespace, words or [])


@app.command()
@examples(
    ("vast exec cluster setup --list", "List the cluster configurations"),
    ("vast exec cluster setup minikube -n lab", "Install RoboVAST in the namespace lab"),
)
def setup(
    cluster_config: Annotated[
        str | None,
        typer.Argument(
            metavar="CLUSTER_CONFIG",
            help="Cluster configuration, for example `gcp`.",
            show_default=False,
        ),
    ] = None,
    list_: Annotated[
        bool, typer.Option("--list", help="List the cluster configurations and exit.")
    ] = False,
    option: ConfigOption = None,
    force: Annotated[
        bool,
        typer.Option(
            "-f",
            "--force",
            help="Replace an installation with a different cluster configuration.",
        ),
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Install or upgrade RoboVAST in the cluster (requires Helm)."""
    from robovast_cli.commands.exec.cluster import setup as cluster_setup

    if list_ or cluster_config is None:
        return cluster_setup.list_configs()
    return cluster_setup.setup(cluster_config, option or [], context, namespace, force=force)


@app.command()
@examples(
    ("vast exec cluster cleanup -n lab", "Delete the installation in the namespace lab"),
    ("vast exec cluster cleanup --force", "Delete it while campaigns run"),
)
def cleanup(
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Delete RoboVAST even if campaigns are running.")
    ] = False,
    _config: Annotated[str | None, setup_config("c")] = None,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Delete RoboVAST from the cluster, but keep Campaigns and CRDs.

    The results in the embedded storage are kept, unless the chart value `storage.embedded.keep`
    is false. Requires Helm.
    """
    from robovast_cli.commands.exec.cluster import setup as cluster_setup

    cluster_setup.cleanup(context, namespace, force=force)


@app.command()
@examples(
    ("vast exec cluster prepare-setup chart --cluster-config gcp", "Write to the folder chart"),
    ("vast exec cluster prepare-setup chart --cluster-config rke2 -n lab", "Use a namespace"),
)
def prepare_setup(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="New or empty folder.")],
    cluster_config: Annotated[
        str,
        typer.Option(
            "--cluster-config",
            metavar="NAME",
            help="Cluster configuration, for example `gcp`.",
        ),
    ],
    option: ConfigOption = None,
    namespace: Annotated[
        str,
        typer.Option("-n", "--namespace", metavar="NAME", help="Namespace of the installation."),
    ] = "default",
) -> None:
    """Write the chart, its values and instructions for a manual setup."""
    from robovast_cli.commands.exec.cluster import setup as cluster_setup

    cluster_setup.prepare_setup(cluster_config, option or [], out, namespace)


@app.command()
@examples(
    ("vast exec cluster prepare-run manual", "Prepare all configurations"),
    ("vast exec cluster prepare-run manual -c 'hall-*' --runs 2", "Prepare a selection"),
)
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
    """Write the Campaign and instructions to run it with kubectl."""
    from robovast.kubeapi.submission import SubmitOptions
    from robovast_cli.commands.exec.cluster import prepare as cluster_prepare

    options = SubmitOptions(config, runs, image, log_tree, debug, context)
    cluster_prepare.prepare_run(ctx.obj.document(), options, namespace, out)


@app.command()
@examples(
    ("vast exec cluster stop", "Stop the only running campaign"),
    ("vast exec cluster stop -i hall-x7k2p", "Stop a campaign by its name"),
)
def stop(
    campaign: CampaignName = None, context: Context = None, namespace: Namespace = None
) -> None:
    """Stop a campaign and keep its stored runs.

    Pods terminate. Runs in progress are not stored, but run again after `resume`.
    """
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.stop(context, namespace, campaign)


@app.command()
@examples(
    ("vast exec cluster resume", "Resume the only stopped campaign"),
    ("vast exec cluster resume -i hall-x7k2p --batches 20", "Extend a search to 20 batches"),
)
def resume(
    campaign: CampaignName = None,
    batches: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Total number of batches after which a search stops, instead of its `budget` and "
            "`stopping`. Extends a finished search also.",
        ),
    ] = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Resume a stopped campaign after its last stored run."""
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.resume(context, namespace, campaign, batches)


@app.command()
@examples(
    ("vast exec cluster retry", "Retry the only campaign with unsuccessful runs"),
    ("vast exec cluster retry -i hall-x7k2p", "Retry a campaign by its name"),
)
def retry(
    campaign: CampaignName = None, context: Context = None, namespace: Namespace = None
) -> None:
    """Run the failed and errored runs of a finished campaign again."""
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.retry(context, namespace, campaign)


@app.command()
@examples(
    ("vast exec cluster run-cleanup", "Delete all finished campaigns"),
    ("vast exec cluster run-cleanup -i hall-x7k2p --data", "Delete a campaign and its results"),
)
def run_cleanup(
    campaign: CampaignName = None,
    data: Annotated[
        bool, typer.Option("--data", help="Also delete the results from the object storage.")
    ] = False,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Delete finished Campaigns from the cluster, but keep their results.

    With --campaign, deletes this Campaign even if it is running.
    """
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.run_cleanup(context, namespace, campaign, data=data)


@app.command()
@examples(
    ("vast exec cluster download-cleanup", "Delete results after confirmation"),
    ("vast exec cluster download-cleanup -i hall-x7k2p --yes", "Delete results of one campaign"),
)
def download_cleanup(
    campaign: CampaignName = None,
    yes: Annotated[bool, typer.Option("-y", "--yes", help="Do not ask for confirmation.")] = False,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Delete the results of finished campaigns from the object storage."""
    from robovast_cli.commands.exec.cluster import control as cluster_control

    cluster_control.download_cleanup(context, namespace, campaign, ask=not yes)


@app.command()
@examples(
    ("vast exec cluster upload-to-share", "Upload all finished campaigns"),
    ("vast exec cluster upload-to-share -i hall-x7k2p --force", "Replace the archive of one"),
)
def upload_to_share(
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="Campaign, by its name or the name of its results folder (default: all finished "
            "campaigns of the namespace) (repeatable).",
            show_default=False,
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Replace existing archives on the file share.")
    ] = False,
    detach: Annotated[bool, typer.Option("--detach", help="Start the upload and exit.")] = False,
    image: Annotated[
        str | None,
        typer.Option(
            "--image",
            help="Image of the RoboVAST agent, for example with your own share provider "
            "(default: the agent image of the campaigns).",
            show_default=False,
        ),
    ] = None,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Upload results of finished campaigns to the remote file share.

    The upload runs in the cluster. Ctrl-C stops only the display. Existing archives are kept.

    ROBOVAST_SHARE_TYPE (nextcloud, webdav, sftp or gcs) and the variables of its type describe the
    file share. Set them in the environment or in a `.env` file in this folder or above. The
    documentation lists the variables on the page "Publish, merge, import and share results".
    """
    from robovast_cli.commands.exec.cluster.share import How, upload_to_share

    return upload_to_share(context, namespace, campaign or [], How(force, detach, image))
