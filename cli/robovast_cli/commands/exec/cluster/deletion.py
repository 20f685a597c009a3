"""`vast exec cluster run-cleanup` and `download-cleanup`: delete campaigns and results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from robovast.base.backoff import wait_until
from robovast.base.errors import CannotRunError, InputError
from robovast.kubeapi.resources import UID_LABEL
from robovast.storage.bucket_ownership import is_owned
from robovast_cli.kube.api import KubernetesClient, connect
from robovast_cli.kube.options import CampaignName, Context, Namespace, SetupOptions
from robovast_cli.kube.status import CampaignState, campaign_states, find_campaign
from robovast_cli.kube.store import open_store, place_of
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo

PATIENCE = 120.0
"""Time limit for the end of a campaign's pods [s]."""
PAUSE = 0.5
"""Time between two requests [s]."""


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
    with connect(context, namespace) as kube:
        if campaign is None:
            delete_finished(kube, data=data)
        else:
            chosen = find_campaign(campaign_states(kube), campaign, kube.namespace)
            _delete([chosen], kube, data=data)


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
    with connect(context, namespace) as kube:
        known = campaign_states(kube)
        chosen = [find_campaign(known, campaign, kube.namespace)] if campaign else known
        found = [one for one in chosen if one.finished and one.bucket]
        if campaign and not found:
            raise InputError(
                f"{campaign} is not finished, or has no results in the object storage.",
                hint="run `vast exec cluster monitor` to see its progress",
            )
        for one in found:
            echo(f"{one.name}: bucket {one.bucket}")
        if found and not yes:
            typer.confirm("Delete these results from the object storage?", abort=True)
        for one in found:
            _delete_bucket(kube, one)
        echo(f"Deleted: {len(found)}.")


def delete_finished(kube: KubernetesClient, *, data: bool = False) -> None:
    """Delete the finished campaigns of the namespace, with `data` also their buckets."""
    campaigns = campaign_states(kube)
    _delete([campaign for campaign in campaigns if campaign.finished], kube, data=data)
    for campaign in campaigns:
        if not campaign.finished:
            echo(
                f"{campaign.name}: still running. To delete it: vast exec cluster run-cleanup -i "
                f"{campaign.name}{kube.cluster_options}"
            )


def _delete(campaigns: Sequence[CampaignState], kube: KubernetesClient, *, data: bool) -> None:
    """Delete campaigns, and with `data` their buckets when no pod can write into them."""
    for campaign in campaigns:
        kube.delete_campaign(campaign.name)
    for campaign in campaigns:
        _wait_until_gone(kube, campaign, with_pods=data)
        if data:
            _delete_bucket(kube, campaign)
        known = "its results" if campaign.status.bucket else "its results, if any,"
        kept = f"; {known} remain in the bucket {campaign.bucket}" if campaign.bucket else ""
        kept = "" if data else kept
        echo(f"{campaign.name}: deleted{kept}.")


def _delete_bucket(kube: KubernetesClient, campaign: CampaignState) -> None:
    """Delete the bucket of a campaign, if it exists.

    Raises:
        OtherOwnerError: it belongs to another campaign.
    """
    if campaign.bucket:
        with open_store(kube, place_of(campaign)) as store:
            is_owned(store, campaign.bucket, campaign.uid)
            store.delete_bucket(campaign.bucket)


def _wait_until_gone(kube: KubernetesClient, campaign: CampaignState, *, with_pods: bool) -> None:
    def is_gone() -> bool:
        there = _exists(kube, campaign)
        return not (there or (with_pods and kube.has_pods({UID_LABEL: campaign.uid})))

    if not wait_until(is_gone, PATIENCE, PAUSE):
        raise CannotRunError(
            f"{campaign.name}: is marked for deletion, but still exists",
            hint=f"check `kubectl describe campaign {campaign.name}` and `kubectl get pods`, "
            "then run the command again",
        )


def _exists(kube: KubernetesClient, campaign: CampaignState) -> bool:
    found = kube.campaign(campaign.name)
    return found is not None and CampaignState(found).uid == campaign.uid
