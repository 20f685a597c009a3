"""`vast exec cluster run`: submit a campaign and show its progress."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

from robovast.base.any_yaml import dump_any
from robovast.base.environment import environment
from robovast.base.errors import ExitCode, RobovastError
from robovast.kubeapi.submission import Submission, SubmitOptions, campaign_name, prepare_submission
from robovast.model.document import Document
from robovast.storage.bucket_names import BUNDLES_BUCKET
from robovast_cli.commands.exec.cluster import notifying, sharing
from robovast_cli.commands.exec.cluster.remove import remove_finished
from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.api_errors import NotFoundError, UnreachableError
from robovast_cli.kube.status import CampaignState
from robovast_cli.kube.store import installed_place, open_store
from robovast_cli.ui.cluster_view import follow_view
from robovast_cli.ui.output import say
from robovast_cli.ui.report import tell

INTERVAL = 1.0
"""Time between two looks at a campaign [s]."""
QUEUE = "robovast"
"""Kueue LocalQueue that `setup` makes where Kueue is installed."""


def print_campaign(
    document: Document, options: SubmitOptions, namespace: str | None, form: Literal["yaml", "json"]
) -> ExitCode:
    """Print the Campaign of a document, for Git."""
    name = campaign_name(document, unique=False)
    submission = prepare_submission(document, options, name, namespace)
    campaign = submission.campaign
    text = dump_any(campaign) if form == "yaml" else json.dumps(campaign, indent=2) + "\n"
    sys.stdout.write(text)
    if submission.archive:
        _warn_of_archive(submission)
    return ExitCode.OK


def run(
    document: Document,
    options: SubmitOptions,
    context: str | None,
    namespace: str | None,
    *,
    detach: bool,
    clean_before: bool,
) -> ExitCode:
    """Run a campaign on a cluster.

    Args:
        document: the checked document.
        options: settings in addition to the document.
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        detach: do not wait for the end.
        clean_before: remove finished campaigns before.
    """
    name = campaign_name(document, unique=True)
    told, shared = notifying.receivers(environment()), sharing.share_of(environment())
    with connect(context, namespace) as kube:
        submission = _prepared(kube, document, options, name)
        if clean_before:
            remove_finished(kube)
        campaign = _submitted(kube, submission, told, shared)
        say(f"Campaign {campaign.name} was created in the namespace {kube.namespace}.")
        notifying.begin(kube, campaign.resource, told)
        sharing.begin(kube, campaign.resource, shared)
        if detach:
            _say_next_commands(kube, campaign)
            return ExitCode.OK
        return _follow(kube, campaign)


def _submitted(
    kube: Kubernetes, submission: Submission, told: Mapping[str, str], shared: Mapping[str, str]
) -> CampaignState:
    """Create the Campaign of a document.

    Args:
        kube: the cluster.
        submission: the document.
        told: receivers of notifications (`notifying.receivers`).
        shared: variables of the share for its results (`sharing.share_of`).
    """
    campaign = sharing.with_share(notifying.with_notifications(submission.campaign, told), shared)
    if submission.archive:
        _upload(kube, submission)
    try:
        return CampaignState(kube.create_campaign(campaign))
    except (KeyboardInterrupt, UnreachableError):  # it may have been created
        _take_back(kube, CampaignState(campaign).name)
        raise


def _take_back(kube: Kubernetes, name: str) -> None:
    """Delete a Campaign, if it is there; say if it may be left."""
    try:
        kube.delete_campaign(name)
    except NotFoundError:
        return
    except RobovastError as error:
        say(
            f"The campaign {name} may still exist in the namespace {kube.namespace}: {error} "
            f"Check with `vast exec cluster monitor --once{kube.given}`."
        )


def _prepared(
    kube: Kubernetes, document: Document, options: SubmitOptions, name: str
) -> Submission:
    queue = options.queue or (QUEUE if kube.has_queue(QUEUE) else None)
    chosen = replace(options, context=kube.context, queue=queue)
    return prepare_submission(document, chosen, name, kube.namespace)


def _follow(kube: Kubernetes, campaign: CampaignState) -> ExitCode:
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
        say(f"\nDisplay stopped. The campaign {campaign.name} continues in the cluster.")
        _say_next_commands(kube, campaign)
        return ExitCode.INTERRUPTED
    if state is None:
        place = f"the cluster (namespace {kube.namespace})"
        tell(f"error: {campaign.name} was deleted from {place}.")
        return ExitCode.CANNOT_RUN
    for line in state.summary():
        say(line)
    say(f"Results: {_download(kube, campaign)}")
    return state.exit_code


def _say_next_commands(kube: Kubernetes, campaign: CampaignState) -> None:
    """Print what can be done with a campaign that is being executed."""
    say(f"Watch:    vast exec cluster monitor{kube.given}")
    say(f"Stop:     vast exec cluster stop -i {campaign.name}{kube.given}")
    say(f"Results:  {_download(kube, campaign)}")


def _download(kube: Kubernetes, campaign: CampaignState) -> str:
    return f"vast results download -i {campaign.name}{kube.given}"


def _next_state(kube: Kubernetes, state: CampaignState) -> CampaignState | None:
    """The campaign as it is now, None once it is gone; as before without an API server."""
    try:
        found = kube.campaign(state.name)
    except UnreachableError:
        return state
    return CampaignState(found) if found is not None else None


def _upload(kube: Kubernetes, submission: Submission) -> None:
    archive = submission.archive
    assert archive is not None  # noqa: S101  # the caller looked
    say(f"Uploading the files of the .vast file ({len(archive.content) / 1e6:.1f} MB) …")
    known = [CampaignState(item) for item in kube.campaigns()]
    with open_store(kube, installed_place(kube, known)) as store:
        store.make_bucket(BUNDLES_BUCKET)
        store.put_bytes(BUNDLES_BUCKET, archive.key, archive.content)


def _warn_of_archive(submission: Submission) -> None:
    archive = submission.archive
    assert archive is not None  # noqa: S101  # the caller looked
    print(  # noqa: T201
        "note: the files of the .vast file are too large for the Campaign, which expects them at "
        f"s3://{BUNDLES_BUCKET}/{archive.key}. `vast exec cluster prepare-run DIR` writes this "
        "archive. Or keep the files in Git and set `source: {git: …}`.",
        file=sys.stderr,
    )
