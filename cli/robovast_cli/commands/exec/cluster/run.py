"""`vast exec cluster run`: submit a campaign and show its progress."""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace
from typing import Annotated, Literal

import typer

from robovast.base.environment import environment
from robovast.base.errors import ExitCode, InputError, RobovastError
from robovast.base.serialization import dump_yaml
from robovast.kubeapi.submission import (
    Archive,
    Submission,
    SubmitOptions,
    campaign_name,
    prepare_submission,
)
from robovast.model.document import Document
from robovast.storage.bucket_names import BUNDLES_BUCKET
from robovast_cli.commands.exec.cluster.campaign_secrets import CampaignSecrets, read_secrets
from robovast_cli.commands.exec.cluster.deletion import delete_finished
from robovast_cli.commands.exec.cluster.estimate import print_estimate
from robovast_cli.commands.exec.local import Debug, LogTree, Runs, Select
from robovast_cli.kube.api import KubernetesClient, connect
from robovast_cli.kube.api_errors import NotFoundError, UnreachableError
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.kube.status import CampaignState, campaign_states
from robovast_cli.kube.store import installed_place, open_store
from robovast_cli.lazy import examples, exit_codes
from robovast_cli.ui.cluster_view import follow_view
from robovast_cli.ui.output import echo
from robovast_cli.ui.report import echo_stderr, in_form
from robovast_cli.workspace import shown

INTERVAL = 1.0
"""Time between two looks at a campaign [s]."""
QUEUE = "robovast"
"""Kueue LocalQueue that `setup` makes where Kueue is installed."""


Image = Annotated[
    str | None,
    typer.Option(
        "--image",
        envvar="ROBOVAST_IMAGE",
        show_envvar=False,
        help="Container image (default: $ROBOVAST_IMAGE, else `execution.image`).",
    ),
]


@exit_codes(
    "0 all passed · 1 a run failed · 2 invalid input · 3 cannot run · 4 a run "
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
            "--parallelism", min=1, help="Maximum number of concurrent pods (default: 100)."
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
        ),
    ] = None,
    queue_priority: Annotated[
        str | None,
        typer.Option(
            "--queue-priority",
            metavar="NAME",
            help="Kueue WorkloadPriorityClass; higher priorities are admitted first.",
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
        return _print_campaign(document, options, namespace, output)
    if estimate:
        print_estimate(document, options, context, namespace)
        return ExitCode.OK
    _check_image(document, options)
    name = campaign_name(document, unique=True)
    secrets = read_secrets(environment())
    with connect(context, namespace) as kube:
        submission = _prepare(kube, document, options, name)
        if cleanup:
            delete_finished(kube)
        campaign = _submit(kube, submission, secrets)
        echo(f"Campaign {campaign.name} was created in the namespace {kube.namespace}.")
        secrets.create(kube, campaign.resource)
        if detach:
            _print_next_commands(kube, campaign)
            return ExitCode.OK
        return _follow(kube, campaign)


def _check_image(document: Document, options: SubmitOptions) -> None:
    """Raise an error if a campaign has no image, which local processes do not need."""
    if not (options.image or document.vast.execution.image):
        raise InputError(
            "runs on a cluster need a container image",
            hint=f"set `--image`, ROBOVAST_IMAGE or `execution.image` in {shown(document.path)}",
        )


def _print_campaign(
    document: Document, options: SubmitOptions, namespace: str | None, form: Literal["yaml", "json"]
) -> ExitCode:
    """Print the Campaign of a document, for Git."""
    name = campaign_name(document, unique=False)
    submission = prepare_submission(document, options, name, namespace)
    campaign = submission.campaign
    text = dump_yaml(campaign) if form == "yaml" else json.dumps(campaign, indent=2) + "\n"
    sys.stdout.write(text)
    if submission.archive:
        _warn_of_archive(submission.archive)
    return ExitCode.OK


def _submit(
    kube: KubernetesClient, submission: Submission, secrets: CampaignSecrets
) -> CampaignState:
    """Create the Campaign of a `.vast` file."""
    campaign = secrets.add_to(submission.campaign)
    if submission.archive:
        _upload(kube, submission.archive)
    try:
        return CampaignState(kube.create_campaign(campaign))
    except (KeyboardInterrupt, UnreachableError):  # it may have been created
        _delete_if_created(kube, CampaignState(campaign).name)
        raise


def _delete_if_created(kube: KubernetesClient, name: str) -> None:
    """Delete a Campaign, if it exists; print a warning if it may still exist."""
    try:
        kube.delete_campaign(name)
    except NotFoundError:
        return
    except RobovastError as error:
        echo(
            f"The campaign {name} may still exist in the namespace {kube.namespace}: {error} "
            f"Check with `vast exec cluster monitor --once{kube.cluster_options}`."
        )


def _prepare(
    kube: KubernetesClient, document: Document, options: SubmitOptions, name: str
) -> Submission:
    queue = options.queue or (QUEUE if kube.has_queue(QUEUE) else None)
    chosen = replace(options, context=kube.context, queue=queue)
    return prepare_submission(document, chosen, name, kube.namespace)


def _follow(kube: KubernetesClient, campaign: CampaignState) -> ExitCode:
    """Show a campaign until it ends, or is gone; Ctrl-C ends only that."""
    state: CampaignState | None = campaign
    try:
        with follow_view() as view:
            while state is not None:
                view.update([state])
                if state.finished:
                    break
                time.sleep(INTERVAL)
                state = _next_state(kube, state)
    except KeyboardInterrupt:
        echo(f"\nDisplay stopped. The campaign {campaign.name} continues in the cluster.")
        _print_next_commands(kube, campaign)
        return ExitCode.INTERRUPTED
    if state is None:
        place = f"the cluster (namespace {kube.namespace})"
        echo_stderr(in_form(f"{campaign.name} was deleted from {place}"))
        return ExitCode.CANNOT_RUN
    for line in state.summary():
        echo(line)
    echo(f"Results: {_download(kube, campaign)}")
    return state.exit_code


def _print_next_commands(kube: KubernetesClient, campaign: CampaignState) -> None:
    """Print commands for a running campaign."""
    echo(f"Watch:    vast exec cluster monitor{kube.cluster_options}")
    echo(f"Stop:     vast exec cluster stop -i {campaign.name}{kube.cluster_options}")
    echo(f"Results:  {_download(kube, campaign)}")


def _download(kube: KubernetesClient, campaign: CampaignState) -> str:
    return f"vast results download -i {campaign.name}{kube.cluster_options}"


def _next_state(kube: KubernetesClient, state: CampaignState) -> CampaignState | None:
    """The campaign as it is now, None once it is gone; as before without an API server."""
    try:
        found = kube.campaign(state.name)
    except UnreachableError:
        return state
    return CampaignState(found) if found is not None else None


def _upload(kube: KubernetesClient, archive: Archive) -> None:
    echo(f"Uploading the files of the .vast file ({len(archive.content) / 1e6:.1f} MB) …")
    known = campaign_states(kube)
    with open_store(kube, installed_place(kube, known)) as store:
        store.make_bucket(BUNDLES_BUCKET)
        store.put_bytes(BUNDLES_BUCKET, archive.key, archive.content)


def _warn_of_archive(archive: Archive) -> None:
    print(  # noqa: T201
        "note: the files of the .vast file are too large for the Campaign, which expects them at "
        f"s3://{BUNDLES_BUCKET}/{archive.key}. `vast exec cluster prepare-run DIR` writes this "
        "archive. Or keep the files in Git and set `source: {git: …}`.",
        file=sys.stderr,
    )
