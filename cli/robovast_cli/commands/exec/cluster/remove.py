"""Removing campaigns from a cluster, with their data or without."""

from __future__ import annotations

from collections.abc import Sequence

from robovast.base.backoff import wait_until
from robovast.base.errors import CannotRunError
from robovast.kubeapi.resources import UID_LABEL
from robovast.storage.bucket_ownership import is_owned
from robovast_cli.kube.api import Kubernetes
from robovast_cli.kube.status import CampaignState
from robovast_cli.kube.store import open_store, place_of
from robovast_cli.ui.output import say

PATIENCE = 120.0
"""Time limit for the end of a campaign's pods [s]."""
PAUSE = 0.5
"""[s]"""


def remove_finished(kube: Kubernetes, *, data: bool = False) -> None:
    """Remove every finished campaign of the namespace; those that run are named.

    Args:
        kube: the cluster.
        data: remove their buckets, too.
    """
    campaigns = [CampaignState(item) for item in kube.campaigns()]
    remove([campaign for campaign in campaigns if campaign.finished], kube, data=data)
    for campaign in campaigns:
        if not campaign.finished:
            say(
                f"{campaign.name}: still running. To delete it: vast exec cluster run-cleanup -i "
                f"{campaign.name}{kube.given}"
            )


def remove(campaigns: Sequence[CampaignState], kube: Kubernetes, *, data: bool) -> None:
    """Remove campaigns with all that was made for them.

    Args:
        campaigns: which.
        kube: the cluster.
        data: remove their buckets, too, as soon as no pod can write into them.
    """
    for campaign in campaigns:
        kube.delete_campaign(campaign.name)
    for campaign in campaigns:
        _wait_until_gone(kube, campaign, with_pods=data)
        if data:
            remove_bucket(kube, campaign)
        known = "its results" if campaign.status.bucket else "its results, if any,"
        kept = f"; {known} remain in the bucket {campaign.bucket}" if campaign.bucket else ""
        kept = "" if data else kept
        say(f"{campaign.name}: deleted{kept}.")


def remove_bucket(kube: Kubernetes, campaign: CampaignState) -> None:
    """Remove the bucket of a campaign; nothing happens when there is none.

    Raises:
        OtherOwnerError: it belongs to another campaign.
    """
    if campaign.bucket:
        with open_store(kube, place_of(campaign)) as store:
            is_owned(store, campaign.bucket, campaign.uid)
            store.delete_bucket(campaign.bucket)


def _wait_until_gone(kube: Kubernetes, campaign: CampaignState, *, with_pods: bool) -> None:
    def is_gone() -> bool:
        there = _is_there(kube, campaign)
        return not (there or (with_pods and kube.has_pods({UID_LABEL: campaign.uid})))

    if not wait_until(is_gone, PATIENCE, PAUSE):
        raise CannotRunError(
            f"{campaign.name}: is marked for deletion, but still exists",
            hint=f"check `kubectl describe campaign {campaign.name}` and `kubectl get pods`, "
            "then run the command again",
        )


def _is_there(kube: Kubernetes, campaign: CampaignState) -> bool:
    found = kube.campaign(campaign.name)
    return found is not None and CampaignState(found).uid == campaign.uid
