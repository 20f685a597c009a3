"""`vast exec cluster monitor`: how far campaigns are."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence

from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.api_errors import UnreachableError
from robovast_cli.kube.status import CampaignState
from robovast_cli.ui.cluster_view import follow_view, table
from robovast_cli.ui.output import say


def monitor(context: str | None, namespace: str | None, *, interval: float, once: bool) -> None:
    """Show the campaigns of a namespace until none runs.

    Args:
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        interval: time between two looks [s].
        once: print a table of all, and end.
    """
    with connect(context, namespace) as kube:
        if once:
            known = _campaigns(kube)
            none = f"No campaigns in the namespace {kube.namespace}."
            say(table(known).rstrip() if known else none)
            return
        try:
            with follow_view() as view:
                for shown in _looks(kube, interval):
                    view.update(shown)
        except KeyboardInterrupt:
            return
        if not shown:
            say(f"No campaign is running in the namespace {kube.namespace}. `--once` shows all.")


def _campaigns(kube: Kubernetes) -> list[CampaignState]:
    return [CampaignState(item) for item in kube.campaigns()]


def _looks(kube: Kubernetes, interval: float) -> Iterator[Sequence[CampaignState]]:
    """Campaigns that run, and those that did, again and again while one does.

    An API server may be gone for a while.
    """
    watched: set[str] = set()
    campaigns = _campaigns(kube)
    while True:
        active = {c.name for c in campaigns if not (c.finished or c.suspended)}
        watched |= active
        yield [campaign for campaign in campaigns if campaign.name in watched]
        if not active:
            return
        time.sleep(interval)
        with contextlib.suppress(UnreachableError):
            campaigns = _campaigns(kube)
