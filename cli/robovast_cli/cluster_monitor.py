"""`vast exec cluster monitor`: how far campaigns are."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

from robovast_cli.cluster_status import CampaignState
from robovast_cli.cluster_view import follow_view, table
from robovast_cli.kubernetes import Kubernetes, connect
from robovast_cli.output import say
from robovast_cli.refusals import UnreachableError


def monitor(context: str | None, namespace: str | None, *, interval: float, once: bool) -> None:
    """Show all campaigns of a namespace.

    Args:
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        interval: time between two looks [s].
        once: print a table, and end.
    """
    with connect(context, namespace) as kube:
        if once:
            say(_table(kube))
            return
        try:
            with follow_view() as view:
                for campaigns in _looks(kube, interval):
                    view.update(campaigns)
        except KeyboardInterrupt:
            return


def _table(kube: Kubernetes) -> str:
    campaigns = _campaigns(kube)
    return table(campaigns).rstrip() if campaigns else f"No campaigns in {kube.namespace}."


def _campaigns(kube: Kubernetes) -> list[CampaignState]:
    return [CampaignState(item) for item in kube.campaigns()]


def _looks(kube: Kubernetes, interval: float) -> Iterator[Sequence[CampaignState]]:
    """All campaigns, again and again while one runs; an API server may be gone for a while."""
    campaigns = _campaigns(kube)
    yield campaigns
    while not all(campaign.finished or campaign.suspended for campaign in campaigns):
        time.sleep(interval)
        try:
            campaigns = _campaigns(kube)
        except UnreachableError:
            continue
        yield campaigns
