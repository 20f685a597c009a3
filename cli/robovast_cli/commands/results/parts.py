"""Fetching a campaign that was divided among clusters, and merging its parts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from robovast.base.atomic import discard, sweep
from robovast.base.errors import InputError
from robovast.campaign.layout import Layout
from robovast.campaign.merge import origins
from robovast_cli.commands.exec.cluster.parts import Part, check_distinct, part_name, parts_named
from robovast_cli.commands.results.downloading import download_results, results_of
from robovast_cli.commands.results.merging import merge
from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.status import CampaignState, some_names
from robovast_cli.ui.output import say
from robovast_cli.workspace import shown


def download_parts(
    contexts: Sequence[str],
    namespace: str | None,
    names: Sequence[str],
    output: Path,
    *,
    force: bool,
) -> None:
    """Fetch the parts of campaigns from their clusters; merge those that have ended.

    Args:
        contexts: of the kubeconfig, one for each cluster.
        namespace: the contexts' when None.
        names: of the campaigns, as `vast exec cluster run` printed them.
        output: folder for the campaigns' folders; parts are beside them until they are merged.
        force: also download existing parts, and replace campaigns that are merged.

    Raises:
        InputError: no campaign is named, or one context twice, or a cluster has no part of it, or
            its folder here has something else, or more runs.
        StorageError: a part cannot be fetched, or written here.
    """
    check_distinct(contexts)
    if not names:
        raise InputError("name the campaign that was divided among these contexts: `-i NAME`.")
    for name in names:
        _download_divided(contexts, namespace, name, output, force=force)


def _download_divided(
    contexts: Sequence[str], namespace: str | None, name: str, output: Path, *, force: bool
) -> None:
    place = output / f".{name}-parts"
    with ExitStack() as stack:
        clusters = [stack.enter_context(connect(context, namespace)) for context in contexts]
        parts = _parts(clusters, name)
        target = output / _merged_name(name, parts[0].campaign)
        if os.path.exists(target):
            _check_whole(target, name, len(parts))
            if not force:
                _tidy(place, target)
                say(
                    f"{name} is in {shown(target)} already, as it was then. `-f` fetches it again "
                    "and replaces that folder: for runs that were repeated or added since."
                )
                return
        folders = []
        for part in parts:
            say(f"{part.campaign.name}, from {part.kube.context}:")
            results = results_of(part.campaign)
            folders.append(download_results(part.kube, results, place, force=force))
    going = [part.campaign.name for part in parts if not part.campaign.complete]
    if going:
        say(f"{', '.join(going)} has not ended; repeat the command then: it merges the parts.")
        return
    if os.path.exists(target):
        _check_not_fewer(target, folders)
    left_out = merge(folders, target, "part", by_name=True, replace=force).left_out
    if left_out:
        say(f"These runs are in {shown(place)}, where the parts stay as they are.")
    else:
        discard(place)


def _check_not_fewer(merged: Path, parts: Sequence[Path]) -> None:
    """Refuse to replace runs that are nowhere else: a store may remove old objects by itself.

    Raises:
        InputError: the parts have fewer runs than what is merged already.
    """
    here, fetched = _runs_in(merged), sum(map(_runs_in, parts))
    if fetched < here:
        raise InputError(
            f"{shown(merged)} has {here} runs and was not replaced: the clusters now have "
            f"{fetched}. Rename or remove it, and repeat the command, to merge these."
        )


def _tidy(place: Path, merged: Path) -> None:
    """Remove parts that an interrupted command has left, unless the merge has left out any runs."""
    sweep(place.parent)
    if os.path.isdir(place):
        runs = sum(_runs_in(part) for part in place.iterdir() if os.path.isdir(part))
        if runs == _runs_in(merged):
            discard(place)


def _runs_in(campaign: Path) -> int:
    return sum(1 for _ in Layout(campaign).run_folders())


def _parts(clusters: Sequence[Kubernetes], name: str) -> list[Part]:
    """The parts of a campaign in their order; two contexts may be of one cluster."""
    found: dict[str, Part] = {}
    for kube in clusters:
        known = [CampaignState(item) for item in kube.campaigns()]
        mine = list(parts_named(name, len(clusters), known))
        if not mine:
            raise InputError(
                f"{kube.context}: the namespace {kube.namespace} has no campaign "
                f"{part_name(name, 1, len(clusters))} or another of its {len(clusters)} parts; it "
                f"has {some_names(known)}. Name all contexts that {name} was divided among, and no "
                "other."
            )
        found |= {campaign.name: Part(kube, campaign) for campaign in mine}
    names = [part_name(name, number, len(clusters)) for number in range(1, len(clusters) + 1)]
    missing = [part for part in names if part not in found]
    if missing:
        raise InputError(f"none of these clusters has {', '.join(missing)}: was it removed?")
    return [found[part] for part in names]


def _merged_name(name: str, first: CampaignState) -> str:
    """Name of the folder of a divided campaign: that of its first part, without the part's mark."""
    of_part = results_of(first).name
    rest = of_part.removeprefix(first.name)
    return f"{name}{rest}" if rest != of_part else of_part


def _check_whole(folder: Path, name: str, parts: int) -> None:
    """Refuse a folder that has not the runs of all parts, as that of one that was fetched alone.

    Raises:
        InputError: it has not.
    """
    if len(origins(Layout(folder))) < parts:
        raise InputError(
            f"{shown(folder)} is there already, and is not all of {name}; it may be one part. "
            "Rename or remove it, or name another folder for the results with `-o`."
        )
