"""`vast exec cluster run`: hand a document over to the cluster, and watch what becomes of it."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Literal

import yaml

from robovast.base.environment import environment
from robovast.base.errors import CannotRunError, ExitCode
from robovast.kubeapi.submission import Submission, SubmitOptions, campaign_name, prepare_submission
from robovast.model.document import Document
from robovast.storage.bucket_names import BUNDLES_BUCKET
from robovast_cli.commands.exec.cluster import notifying, sharing
from robovast_cli.commands.exec.cluster.remove import remove_finished
from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.api_errors import ConflictError, UnreachableError
from robovast_cli.kube.status import CampaignState
from robovast_cli.kube.store import installed_place, open_store
from robovast_cli.ui.cluster_view import follow_view
from robovast_cli.ui.output import say

INTERVAL = 1.0
"""Time between two looks at a campaign [s]."""
QUEUE = "robovast"
"""Kueue LocalQueue that `setup` makes where Kueue is installed."""
ATTEMPTS = 3
"""Most names that are tried."""


def print_campaign(
    document: Document, options: SubmitOptions, namespace: str | None, form: Literal["yaml", "json"]
) -> ExitCode:
    """Print the Campaign of a document, for Git."""
    name = campaign_name(document, unique=False)
    submission = prepare_submission(document, options, name, namespace)
    campaign = submission.campaign
    text = campaign_yaml(campaign) if form == "yaml" else json.dumps(campaign, indent=2) + "\n"
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
    """Execute a document on a cluster.

    Args:
        document: the checked document.
        options: what counts beside it.
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        detach: do not wait for the end.
        clean_before: remove finished campaigns before.
    """
    told, shared = notifying.receivers(environment()), sharing.share_of(environment())
    with connect(context, namespace) as kube:
        if clean_before:
            remove_finished(kube)
        queue = options.queue or (QUEUE if kube.has_queue(QUEUE) else None)
        chosen = replace(options, context=kube.context, queue=queue)
        campaign = submit(kube, document, chosen, told, shared)
        say(f"Campaign {campaign.name} is in the cluster (namespace {kube.namespace}).")
        notifying.begin(kube, campaign.resource, told)
        sharing.begin(kube, campaign.resource, shared)
        if detach:
            say_how_to_go_on(campaign.name)
            return ExitCode.OK
        return follow(kube, campaign)


def submit(
    kube: Kubernetes,
    document: Document,
    options: SubmitOptions,
    told: Mapping[str, str],
    shared: Mapping[str, str],
) -> CampaignState:
    """Create the Campaign of a document, its archive in S3 before when it needs one.

    Args:
        kube: the cluster.
        document: the checked document.
        options: what counts beside it.
        told: receivers of notifications (`notifying.receivers`).
        shared: variables of the share for its results (`sharing.share_of`).
    """
    for attempt in range(ATTEMPTS):
        name = campaign_name(document, unique=True)
        submission = prepare_submission(document, options, name, kube.namespace)
        if submission.archive and not attempt:
            _upload(kube, submission)
        try:
            wanted = notifying.with_notifications(submission.campaign, told)
            wanted = sharing.with_share(wanted, shared)
            return CampaignState(kube.create_campaign(wanted))
        except ConflictError:
            if attempt == ATTEMPTS - 1:
                raise
    raise AssertionError("unreachable")


def follow(kube: Kubernetes, campaign: CampaignState) -> ExitCode:
    """Show a campaign until it ends; Ctrl-C ends only that."""
    try:
        with follow_view() as view:
            for state in _states(kube, campaign):
                view.update([state])
    except KeyboardInterrupt:
        say(f"\nNo longer followed: the campaign {campaign.name} goes on in the cluster.")
        say_how_to_go_on(campaign.name)
        return ExitCode.INTERRUPTED
    for line in state.summary():
        say(line)
    say(f"Results: vast results download -i {campaign.name}")
    return state.exit_code


def say_how_to_go_on(name: str) -> None:
    """Print what can be done with a campaign that is being executed."""
    say("Watch:    vast exec cluster monitor")
    say(f"Stop:     vast exec cluster stop -i {name}")
    say(f"Results:  vast results download -i {name}")


def _states(kube: Kubernetes, campaign: CampaignState) -> Iterator[CampaignState]:
    """The campaign again and again until it is finished; an API server may be gone for a while."""
    yield campaign
    while not campaign.finished:
        time.sleep(INTERVAL)
        with contextlib.suppress(UnreachableError):
            found = kube.campaign(campaign.name)
            if found is None:
                raise CannotRunError(f"the campaign {campaign.name} was deleted meanwhile.")
            campaign = CampaignState(found)
            yield campaign


def _upload(kube: Kubernetes, submission: Submission) -> None:
    archive = submission.archive
    assert archive is not None  # noqa: S101  # the caller looked
    say(f"Uploading the document's files ({len(archive.content) / 1e6:.1f} MB) …")
    known = [CampaignState(item) for item in kube.campaigns()]
    with open_store(kube, installed_place(kube, known)) as store:
        store.make_bucket(BUNDLES_BUCKET)
        store.put_bytes(BUNDLES_BUCKET, archive.key, archive.content)


class _Dumper(yaml.SafeDumper):
    """Writes multi-line texts as blocks, for readable differences in Git."""


def _text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    return dumper.represent_scalar(
        "tag:yaml.org,2002:str", value, style="|" if "\n" in value else None
    )


_Dumper.add_representer(str, _text)


def campaign_yaml(campaign: dict[str, Any]) -> str:
    """A Campaign as YAML in which its files can be read."""
    text: str = yaml.dump(
        campaign, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=2**31 - 1
    )
    return text


def _warn_of_archive(submission: Submission) -> None:
    archive = submission.archive
    assert archive is not None  # noqa: S101  # the caller looked
    print(  # noqa: T201
        "note: the document's files are too many for the Campaign itself: it expects them as "
        f"s3://{BUNDLES_BUCKET}/{archive.key}. `vast exec cluster prepare-run DIR` writes that "
        "archive; or keep the files in Git and write `source: {git: …}`.",
        file=sys.stderr,
    )
