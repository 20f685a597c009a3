"""Fetching campaigns in front of a user."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from robovast.common.progress import fmt_size
from robovast.errors import CannotRunError, InputError
from robovast.results.download import DownloadObserver, DownloadResult, download_campaign
from robovast_cli.cluster_status import CampaignState
from robovast_cli.cluster_store import open_store, place_of
from robovast_cli.kubernetes import Kubernetes, connect
from robovast_cli.output import say
from robovast_cli.workspace import shown


def download_campaigns(
    context: str | None,
    namespace: str | None,
    names: Sequence[str],
    output: Path,
    *,
    force: bool,
) -> None:
    """Fetch the named campaigns of a namespace, or all."""
    with connect(context, namespace) as kube:
        for campaign in _chosen(kube, names):
            _download(kube, campaign, output, force=force)


def _chosen(kube: Kubernetes, names: Sequence[str]) -> list[CampaignState]:
    known = [CampaignState(item) for item in kube.campaigns()]
    if names:
        return [find_campaign(known, name, kube.namespace) for name in names]
    if not known:
        raise InputError(
            f"there are no campaigns in the namespace {kube.namespace}. `--namespace` chooses "
            "another one."
        )
    return [campaign for campaign in known if campaign.status.bucket]


def find_campaign(known: Sequence[CampaignState], name: str, namespace: str) -> CampaignState:
    """The campaign of a name, or of the name of its results folder.

    Raises:
        InputError: there is none.
    """
    for campaign in known:
        if name in {campaign.name, campaign.status.campaign}:
            return campaign
    names = ", ".join(campaign.name for campaign in known) or "none"
    raise InputError(f"there is no campaign `{name}` in the namespace {namespace}; it has {names}.")


def _download(kube: Kubernetes, campaign: CampaignState, output: Path, *, force: bool) -> None:
    if not campaign.status.bucket:
        raise CannotRunError(
            f"{campaign.name}: nothing is stored yet. `vast exec cluster monitor` shows how far "
            "it is."
        )
    folder = output / campaign.status.campaign
    with (
        open_store(kube, place_of(campaign)) as store,
        _view(campaign.status.campaign) as view,
    ):
        result = download_campaign(store, campaign.status.bucket, folder, view, force=force)
    for line in _summary(result):
        say(line)


def _summary(result: DownloadResult) -> Iterator[str]:
    total = result.fetched + result.present
    here = f" ({result.present} were here)" if result.present else ""
    yield f"{shown(result.campaign)}: {total} runs{here}, {fmt_size(result.size)} fetched."
    if result.unfinished:
        yield f"{len(result.unfinished)} runs are not stored yet; repeat the command later."


def _view(title: str) -> AbstractContextManager[DownloadObserver]:
    return _bar(title) if sys.stdout.isatty() else Silent()


class Silent:
    """Shows nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        """Nothing to end."""

    def planned(self, files: int, size: int) -> None:
        """Say nothing."""

    def received(self, size: int) -> None:
        """Say nothing."""

    def file_finished(self) -> None:
        """Say nothing."""


@contextmanager
def _bar(title: str) -> Iterator[DownloadObserver]:
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
        TransferSpeedColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
        TextColumn("{task.fields[files]}/{task.fields[count]} files"),
        TimeRemainingColumn(),
    )
    with Progress(*columns) as progress:
        yield _Bar(progress, title)


class _Bar:
    """A bar on the terminal."""

    def __init__(self, progress: Any, title: str) -> None:
        self._progress = progress
        self._task = progress.add_task(title, total=None, files=0, count=0)
        self._files = 0

    def planned(self, files: int, size: int) -> None:
        """Set its length."""
        self._progress.update(self._task, total=size, count=files)

    def received(self, size: int) -> None:
        """Advance it."""
        self._progress.advance(self._task, size)

    def file_finished(self) -> None:
        """Count a file."""
        self._files += 1
        self._progress.update(self._task, files=self._files)
