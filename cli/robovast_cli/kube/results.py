"""Locate the results of a campaign in the object storage of a cluster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robovast.base.errors import CannotRunError, InputError
from robovast.storage.bucket_ownership import find_bucket
from robovast_cli.kube.api import KubernetesClient
from robovast_cli.kube.status import CampaignState, find_campaign, lookup
from robovast_cli.kube.store import StorePlace, installed_place, open_store, place_of


@dataclass(frozen=True)
class Results:
    """Results of a campaign in a store."""

    name: str
    """Name of the results folder."""
    bucket: str
    place: StorePlace
    campaign: CampaignState | None = None
    """None if it was deleted."""


def named_results(kube: KubernetesClient, known: Sequence[CampaignState], name: str) -> Results:
    """Find results by name, also if their Campaign was deleted.

    Raises:
        InputError: there are none, or several.
        CannotRunError: the Campaign was rejected.
    """
    place = installed_place(kube, known)
    if lookup(known, name) is None and place.endpoint:
        with open_store(kube, place) as store:
            found = find_bucket(store, name)
        if found is not None:
            bucket, owner = found
            return Results(owner.campaign if owner is not None else name, bucket, place)
    return results_of(find_campaign(known, name, kube.namespace))


def stored_results(
    kube: KubernetesClient, campaigns: Sequence[CampaignState], expected: str = "has results"
) -> list[Results]:
    """Return the results of all campaigns that have some.

    Args:
        kube: the cluster and namespace.
        campaigns: the campaigns to consider.
        expected: end of the error message "no campaign in the namespace …".

    Raises:
        InputError: no campaign has results.
    """
    stored = [campaign for campaign in campaigns if campaign.bucket]
    if not stored:
        raise InputError(
            f"no campaign in the namespace {kube.namespace} {expected}",
            hint="select another namespace with `--namespace`, or name a deleted Campaign with "
            "`--campaign`",
        )
    return [results_of(campaign) for campaign in stored]


def results_of(campaign: CampaignState) -> Results:
    """Return the results of a campaign.

    Raises:
        CannotRunError: the Campaign was rejected.
    """
    if not campaign.bucket:
        why = "; ".join(campaign.messages)
        raise CannotRunError(
            f"{campaign.name} has no results, because it was rejected: {why}",
            hint="fix the cause, then create the campaign again",
        )
    return Results(campaign.folder, campaign.bucket, place_of(campaign), campaign)
