"""`vast exec cluster monitor`: show the progress of campaigns."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence
from typing import Annotated

import typer

from robovast_cli.kube.api import KubernetesClient, connect
from robovast_cli.kube.api_errors import UnreachableError
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.kube.status import CampaignState, campaign_states
from robovast_cli.lazy import examples
from robovast_cli.ui.cluster_view import follow_view, table
from robovast_cli.ui.output import echo


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
    with connect(context, namespace) as kube:
        if once:
            known = campaign_states(kube)
            none = f"No campaigns in the namespace {kube.namespace}."
            echo(table(known).rstrip() if known else none)
            return
        try:
            with follow_view() as view:
                for shown in _observe(kube, interval):
                    view.update(shown)
        except KeyboardInterrupt:
            return
        if not shown:
            echo(f"No campaign is running in the namespace {kube.namespace}. `--once` shows all.")


def _observe(kube: KubernetesClient, interval: float) -> Iterator[Sequence[CampaignState]]:
    """Yield the campaigns that run or have run since the first request, until none runs.

    Skips a request if the API server is unreachable.
    """
    watched: set[str] = set()
    campaigns = campaign_states(kube)
    while True:
        active = {c.name for c in campaigns if c.running}
        watched |= active
        yield [campaign for campaign in campaigns if campaign.name in watched]
        if not active:
            return
        time.sleep(interval)
        with contextlib.suppress(UnreachableError):
            campaigns = campaign_states(kube)
