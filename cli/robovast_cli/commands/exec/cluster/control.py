"""`vast exec cluster stop`, `resume`, `retry`, `run-cleanup` and `download-cleanup`."""

from __future__ import annotations

from collections.abc import Callable

import typer

from robovast.base.errors import InputError
from robovast_cli.commands.exec.cluster.remove import remove, remove_bucket, remove_finished
from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.status import CampaignState, find_campaign
from robovast_cli.ui.output import say


def stop(context: str | None, namespace: str | None, name: str | None) -> None:
    """Stop a campaign; without a name the only one that runs."""
    with connect(context, namespace) as kube:
        campaign = _one(kube, name, lambda c: not c.finished and not c.suspended, "that is running")
        kube.patch_campaign(campaign.name, {"suspend": True})
    say(f"{campaign.name}: stopping pods. Runs in progress are lost; stored runs are kept.")
    say(f"Resume:   vast exec cluster resume -i {campaign.name}{kube.given}")


def resume(
    context: str | None, namespace: str | None, name: str | None, batches: int | None
) -> None:
    """Resume a stopped campaign, or extend a search to a total number of batches.

    Without a name it is the only one that is stopped, or is a search.
    """
    with connect(context, namespace) as kube:
        if batches is None:
            campaign = _one(kube, name, lambda c: c.suspended, "that is stopped")
            kube.patch_campaign(campaign.name, {"suspend": False})
        else:
            campaign = _one(kube, name, _is_search, "that is a search")
            _refuse_fewer(campaign, batches)
            end = {"budget": [{"batches": batches}], "stopping": []}
            kube.patch_campaign(campaign.name, {"suspend": False, "vast": {"search": end}})
    say(f"{campaign.name}: resumed.")


def _is_search(campaign: CampaignState) -> bool:
    return bool(campaign.resource["spec"]["vast"].get("search"))


def _refuse_fewer(campaign: CampaignState, batches: int) -> None:
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


def retry(context: str | None, namespace: str | None, name: str | None) -> None:
    """Repeat the bad runs of a campaign; without a name of the only one that has some."""
    with connect(context, namespace) as kube:
        campaign = _one(kube, name, _can_be_retried, "with unsuccessful runs")
        kube.patch_campaign(campaign.name, {"attempt": campaign.attempt + 1})
    runs = campaign.status.runs
    bad = runs.failed + runs.errored
    say(f"{campaign.name}: retrying {bad} {'run' if bad == 1 else 'runs'}.")


def run_cleanup(
    context: str | None, namespace: str | None, name: str | None, *, data: bool
) -> None:
    """Remove campaigns; without a name all that are finished."""
    with connect(context, namespace) as kube:
        if name is None:
            remove_finished(kube, data=data)
        else:
            remove([_one(kube, name, lambda _: True, "")], kube, data=data)


def download_cleanup(
    context: str | None, namespace: str | None, name: str | None, *, ask: bool
) -> None:
    """Remove buckets; without a name those of all finished campaigns."""
    with connect(context, namespace) as kube:
        known = [CampaignState(item) for item in kube.campaigns()]
        chosen = [find_campaign(known, name, kube.namespace)] if name else known
        doomed = [campaign for campaign in chosen if campaign.finished and campaign.bucket]
        if name and not doomed:
            raise InputError(
                f"{name} is not finished, or has no results in the object storage.",
                hint="run `vast exec cluster monitor` to see its progress",
            )
        for campaign in doomed:
            say(f"{campaign.name}: bucket {campaign.bucket}")
        if doomed and ask:
            typer.confirm("Delete these results from the object storage?", abort=True)
        for campaign in doomed:
            remove_bucket(kube, campaign)
        say(f"Deleted: {len(doomed)}.")


def _can_be_retried(campaign: CampaignState) -> bool:
    runs = campaign.status.runs
    return campaign.finished and runs.failed + runs.errored > 0


def _one(
    kube: Kubernetes, name: str | None, fits: Callable[[CampaignState], bool], what: str
) -> CampaignState:
    """The campaign of a name, else the only one that fits."""
    known = [CampaignState(item) for item in kube.campaigns()]
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
