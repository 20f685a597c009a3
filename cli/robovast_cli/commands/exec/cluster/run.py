"""`vast exec cluster run`: hand a document over to the cluster, and watch what becomes of it."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Literal

import yaml

from robovast.base.environment import environment
from robovast.base.errors import ExitCode, RobovastError
from robovast.kubeapi.submission import Submission, SubmitOptions, campaign_name, prepare_submission
from robovast.model.document import Document
from robovast.storage.bucket_names import BUNDLES_BUCKET
from robovast_cli.commands.exec.cluster import notifying, sharing
from robovast_cli.commands.exec.cluster.parts import Part, divided, part_name, worst
from robovast_cli.commands.exec.cluster.remove import remove_finished
from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.api_errors import NotFoundError, UnreachableError
from robovast_cli.kube.kubeconfig import options_of
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
    text = campaign_yaml(campaign) if form == "yaml" else json.dumps(campaign, indent=2) + "\n"
    sys.stdout.write(text)
    if submission.archive:
        _warn_of_archive(submission)
    return ExitCode.OK


def run(
    document: Document,
    options: SubmitOptions,
    contexts: Sequence[str],
    namespace: str | None,
    *,
    detach: bool,
    clean_before: bool,
) -> ExitCode:
    """Execute a document on a cluster, or a part of it on each of several.

    Args:
        document: the checked document.
        options: what counts beside it.
        contexts: of the kubeconfig, one for each cluster; the current one when there is none.
        namespace: the contexts' when None.
        detach: do not wait for the end.
        clean_before: remove finished campaigns before.

    Raises:
        InputError: there is nothing to divide among so many.
    """
    wanted = divided(document, options, contexts)
    name = campaign_name(document, unique=True)
    download = f"vast results download -i {name}{options_of(contexts, namespace)}"
    told, shared = notifying.receivers(environment()), sharing.share_of(environment())
    with ExitStack() as stack:
        clusters = [stack.enter_context(connect(context, namespace)) for context in contexts]
        clusters = clusters or [stack.enter_context(connect(None, namespace))]
        submissions = [
            _prepared(kube, document, part, part_name(name, number, len(clusters)))
            for number, (kube, part) in enumerate(zip(clusters, wanted, strict=True), 1)
        ]
        if clean_before:
            for kube in clusters:
                remove_finished(kube)
        parts = _submitted(clusters, submissions, told, shared)
        for part in parts:
            say(f"Campaign {part.campaign.name} is in {_where(part.kube, contexts)}.")
            notifying.begin(part.kube, part.campaign.resource, told)
            sharing.begin(part.kube, part.campaign.resource, shared)
        if detach:
            _say_how_to_go_on(parts, download)
            return ExitCode.OK
        return _follow(parts, contexts, download)


def _where(kube: Kubernetes, contexts: Sequence[str]) -> str:
    cluster = f"cluster of {kube.context}" if len(contexts) > 1 else "cluster"
    return f"the {cluster} (namespace {kube.namespace})"


def _submitted(
    clusters: Sequence[Kubernetes],
    submissions: Sequence[Submission],
    told: Mapping[str, str],
    shared: Mapping[str, str],
) -> list[Part]:
    """Create the Campaigns of a document: all of them, or after an error none.

    Args:
        clusters: one for each part.
        submissions: the parts.
        told: receivers of notifications (`notifying.receivers`).
        shared: variables of the share for its results (`sharing.share_of`).
    """
    parts: list[Part] = []
    for kube, submission in zip(clusters, submissions, strict=True):
        campaign = notifying.with_notifications(submission.campaign, told)
        campaign = sharing.with_share(campaign, shared)
        try:
            if submission.archive:
                _upload(kube, submission)
            parts.append(Part(kube, CampaignState(kube.create_campaign(campaign))))
        except BaseException as error:
            refused = isinstance(error, RobovastError) and not isinstance(error, UnreachableError)
            _take_back(parts if refused else [*parts, Part(kube, CampaignState(campaign))])
            raise
    return parts


def _take_back(parts: Sequence[Part]) -> None:
    """Delete Campaigns, if they are there; say which may be left."""
    for part in parts:
        name, kube = part.campaign.name, part.kube
        try:
            kube.delete_campaign(name)
        except NotFoundError:
            continue
        except RobovastError as error:
            say(
                f"The campaign {name} may be left behind in the namespace {kube.namespace}: {error}"
                f" `vast exec cluster monitor --once --context {kube.context}` shows whether it is."
            )


def _prepared(
    kube: Kubernetes, document: Document, options: SubmitOptions, name: str
) -> Submission:
    queue = options.queue or (QUEUE if kube.has_queue(QUEUE) else None)
    chosen = replace(options, context=kube.context, queue=queue)
    return prepare_submission(document, chosen, name, kube.namespace)


def _follow(parts: Sequence[Part], contexts: Sequence[str], download: str) -> ExitCode:
    """Show campaigns until they end, or are gone; Ctrl-C ends only that.

    Args:
        parts: the campaign, or its parts.
        contexts: those that the user named.
        download: the command that fetches its results.
    """
    try:
        with follow_view() as view:
            for states in _states(parts):
                view.update([state for state in states if state is not None])
    except KeyboardInterrupt:
        say(f"\nNo longer followed: {_goes_on(parts)}.")
        _say_how_to_go_on(parts, download)
        return ExitCode.INTERRUPTED
    return _end(parts, states, contexts, download)


def _end(
    parts: Sequence[Part],
    states: Sequence[CampaignState | None],
    contexts: Sequence[str],
    download: str,
) -> ExitCode:
    """Say how campaigns have ended, and which are gone."""
    ends = [state for state in states if state is not None]
    for state in ends:
        part = f"{state.name}: " if len(states) > 1 else ""
        for line in state.summary():
            say(f"{part}{line}")
    gone = [part for part, state in zip(parts, states, strict=True) if state is None]
    codes = [state.exit_code for state in ends]
    if not gone:
        say(f"Results: {download}")
        return worst(codes)
    for left in (part for part in parts if part not in gone):
        say(f"Results: vast results download -i {left.campaign.name}{left.kube.given}")
    for lost in gone:
        tell(f"error: {lost.campaign.name} was deleted from {_where(lost.kube, contexts)}.")
    return worst([*codes, ExitCode.CANNOT_RUN])


def _goes_on(parts: Sequence[Part]) -> str:
    if len(parts) == 1:
        return f"the campaign {parts[0].campaign.name} goes on in the cluster"
    return f"{', '.join(part.campaign.name for part in parts)} go on in their clusters"


def _say_how_to_go_on(parts: Sequence[Part], download: str) -> None:
    """Print what can be done with campaigns that are being executed."""
    for part in parts:
        given = part.kube.given
        say(f"Watch:    vast exec cluster monitor{given}")
        say(f"Stop:     vast exec cluster stop -i {part.campaign.name}{given}")
    say(f"Results:  {download}")


def _states(parts: Sequence[Part]) -> Iterator[list[CampaignState | None]]:
    """The campaigns again and again until none goes on; an API server may be gone a while."""
    states: list[CampaignState | None] = [part.campaign for part in parts]
    yield states
    while not all(state is None or state.finished for state in states):
        time.sleep(INTERVAL)
        states = [_next_state(part.kube, s) for part, s in zip(parts, states, strict=True)]
        yield states


def _next_state(kube: Kubernetes, state: CampaignState | None) -> CampaignState | None:
    """The campaign as it is now, None once it is gone; as before without an API server."""
    if state is None or state.finished:
        return state
    try:
        found = kube.campaign(state.name)
    except UnreachableError:
        return state
    return CampaignState(found) if found is not None else None


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
