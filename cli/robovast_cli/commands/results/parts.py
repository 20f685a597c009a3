"""Fetching a campaign that was divided among clusters, and merging its parts."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from robovast.base.errors import InputError
from robovast_cli.commands.exec.cluster.parts import check_distinct, parts_named
from robovast_cli.commands.results.downloading import download_results, results_of
from robovast_cli.commands.results.merging import merge
from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.status import CampaignState
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
        force: also download existing parts.

    Raises:
        InputError: no campaign is named, or one context twice, or a cluster has no part of it.
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
        parts = [(kube, _part_in(kube, name, len(contexts))) for kube in clusters]
        target = output / results_of(parts[0][1]).name
        if target.exists():
            say(f"{name} is in {shown(target)} already; remove that folder to fetch it again.")
            return
        folders = []
        for kube, part in parts:
            say(f"{part.name}, from {kube.context}:")
            folders.append(download_results(kube, results_of(part), place, force=force))
    going = [part.name for _, part in parts if not part.finished]
    if going:
        say(f"{', '.join(going)} has not ended; repeat the command then: it merges the parts.")
        return
    merge(folders, target, "part", by_name=True)
    shutil.rmtree(place)


def _part_in(kube: Kubernetes, name: str, of: int) -> CampaignState:
    """The part that a cluster executes."""
    known = [CampaignState(item) for item in kube.campaigns()]
    found = next(parts_named(name, of, known), None)
    if found is None:
        raise InputError(
            f"{kube.context}: the namespace {kube.namespace} has no part of the campaign {name}. "
            "Name all contexts that it was divided among, and no other; `vast exec cluster "
            f"monitor --once --context {kube.context}` lists what is there."
        )
    return found
