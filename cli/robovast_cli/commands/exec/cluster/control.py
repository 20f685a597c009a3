"""`vast exec cluster stop`, `resume` and `retry`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from robovast.base.errors import InputError
from robovast_cli.kube.api import KubernetesClient, connect
from robovast_cli.kube.options import CampaignName, Context, Namespace
from robovast_cli.kube.status import CampaignState, campaign_states, find_campaign
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.ui.table import counted


@examples(
    ("vast exec cluster stop", "Stop the only running campaign"),
    ("vast exec cluster stop -i hall-x7k2p", "Stop a campaign by its name"),
)
def stop(
    campaign: CampaignName = None, context: Context = None, namespace: Namespace = None
) -> None:
    """Stop a campaign and keep its stored runs.

    Pods terminate. Runs in progress are not stored, but run again after `resume`.
    """
    with connect(context, namespace) as kube:
        chosen = _select(kube, campaign, lambda c: c.running, "that is running")
        kube.patch_campaign(chosen.name, {"suspend": True})
    echo(f"{chosen.name}: stopping pods. Runs in progress are lost; stored runs are kept.")
    echo(f"Resume:   vast exec cluster resume -i {chosen.name}{kube.cluster_options}")


@examples(
    ("vast exec cluster resume", "Resume the only stopped campaign"),
    ("vast exec cluster resume -i hall-x7k2p --batches 20", "Extend a search to 20 batches"),
)
def resume(
    campaign: CampaignName = None,
    batches: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Total number of batches after which a search stops, instead of its `budget` and "
            "`stopping`. Extends a finished search also.",
        ),
    ] = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Resume a stopped campaign after its last stored run."""
    with connect(context, namespace) as kube:
        if batches is None:
            chosen = _select(kube, campaign, lambda c: c.suspended, "that is stopped")
            kube.patch_campaign(chosen.name, {"suspend": False})
        else:
            chosen = _select(kube, campaign, lambda c: c.is_search, "that is a search")
            _check_batches(chosen, batches)
            end = {"budget": [{"batches": batches}], "stopping": []}
            kube.patch_campaign(chosen.name, {"suspend": False, "vast": {"search": end}})
    echo(f"{chosen.name}: resumed.")


@examples(
    ("vast exec cluster retry", "Retry the only campaign with unsuccessful runs"),
    ("vast exec cluster retry -i hall-x7k2p", "Retry a campaign by its name"),
)
def retry(
    campaign: CampaignName = None, context: Context = None, namespace: Namespace = None
) -> None:
    """Run the failed and errored runs of a finished campaign again."""
    with connect(context, namespace) as kube:
        chosen = _select(kube, campaign, _can_be_retried, "with unsuccessful runs")
        kube.patch_campaign(chosen.name, {"attempt": chosen.attempt + 1})
    runs = chosen.status.runs
    bad = runs.failed + runs.errored
    echo(f"{chosen.name}: retrying {counted(bad, 'run')}.")


def _check_batches(campaign: CampaignState, batches: int) -> None:
    """Refuse a number of batches with which no run would start.

    Raises:
        InputError: so many are done.
    """
    search = campaign.status.search
    done = search.batch if search is not None else 0
    if batches <= done:
        raise InputError(
            f"{campaign.name} has {done} batches already, and `--batches` is the total number",
            hint=f"use a number greater than {done}",
        )


def _can_be_retried(campaign: CampaignState) -> bool:
    runs = campaign.status.runs
    return campaign.finished and runs.failed + runs.errored > 0


def _select(
    kube: KubernetesClient, name: str | None, fits: Callable[[CampaignState], bool], what: str
) -> CampaignState:
    """Return the campaign of a name (default: the only one that fits)."""
    known = campaign_states(kube)
    if name is not None:
        campaign = find_campaign(known, name, kube.namespace)
        if not fits(campaign):
            raise InputError(
                f"{name} is not a campaign {what}; its state is {campaign.status.state}.",
                hint=f"run `kubectl get campaigns --namespace {kube.namespace}` to see all states",
            )
        return campaign
    found = [campaign for campaign in known if fits(campaign)]
    if len(found) == 1:
        return found[0]
    names = ", ".join(campaign.name for campaign in found) or "none"
    raise InputError(
        f"which campaign {what} is meant is not clear: the namespace {kube.namespace} has {names}",
        hint="select one with `--campaign`",
    )
