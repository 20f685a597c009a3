"""Download campaigns from object storage, and report progress."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from robovast.base.errors import CannotRunError, InputError, StorageError
from robovast.base.printable import printable
from robovast.base.sizes import fmt_size
from robovast.storage.bucket_ownership import find_bucket, is_owned, owner_of
from robovast.storage.download import DownloadResult, download_campaign
from robovast.storage.folder_ownership import folder_for
from robovast_cli.kube.api import Kubernetes, connect
from robovast_cli.kube.status import CampaignState, find_campaign, lookup
from robovast_cli.kube.store import StorePlace, installed_place, open_store, place_of
from robovast_cli.ui.bars import Bars
from robovast_cli.ui.output import say
from robovast_cli.ui.report import message_of, tell
from robovast_cli.workspace import shown

MOST_TOLD = 20
"""Maximum number of warnings about objects that are skipped or stored under other paths."""


@dataclass(frozen=True)
class Results:
    """Results of a campaign in a store."""

    name: str
    """Name of the results folder."""
    bucket: str
    place: StorePlace
    campaign: CampaignState | None = None
    """None when it was removed."""


def download_campaigns(
    context: str | None,
    namespace: str | None,
    names: Sequence[str],
    output: Path,
    *,
    force: bool,
) -> None:
    """Download the named campaigns of a namespace, or all.

    Args:
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        names: of Campaigns or results folders; none means all Campaigns.
        output: folder for the campaigns' folders.
        force: also download existing campaigns.
    """
    with connect(context, namespace) as kube:
        known = [CampaignState(item) for item in kube.campaigns()]
        chosen = (
            [named_results(kube, known, name) for name in names] if names else _all(kube, known)
        )
        failed = [
            results.name for results in chosen if not _try(kube, results, output, force=force)
        ]
    if failed:
        raise StorageError(
            f"incomplete download: {', '.join(failed)}.",
            hint="run the command again to download the rest",
        )


def download_run(context: str | None, namespace: str | None, run: str, output: Path) -> Path:
    """Download a run with the files that a replay needs; return its folder.

    Args:
        context: of the kubeconfig; the current one when None.
        namespace: the context's when None.
        run: `<campaign>/<configuration>/<number>`.
        output: folder for the campaign's folder.
    """
    name, _, path = run.partition("/")
    with connect(context, namespace) as kube:
        known = [CampaignState(item) for item in kube.campaigns()]
        folder = download_results(kube, named_results(kube, known, name), output, run=path)
    return folder / path


def _all(kube: Kubernetes, known: Sequence[CampaignState]) -> list[Results]:
    stored = [campaign for campaign in known if campaign.bucket]
    if not stored:
        raise InputError(
            f"no campaign in the namespace {kube.namespace} has results",
            hint="set the namespace with `--namespace`, or name a deleted Campaign with "
            "`--campaign`",
        )
    return [results_of(campaign) for campaign in stored]


def named_results(kube: Kubernetes, known: Sequence[CampaignState], name: str) -> Results:
    """Results by name, also those whose Campaign was removed.

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


def results_of(campaign: CampaignState) -> Results:
    """Results of a campaign.

    Raises:
        CannotRunError: the Campaign was rejected.
    """
    if not campaign.bucket:
        why = "; ".join(campaign.messages)
        raise CannotRunError(f"{campaign.name} has no results, because it was rejected: {why}")
    return Results(campaign.folder, campaign.bucket, place_of(campaign), campaign)


def _try(kube: Kubernetes, results: Results, output: Path, *, force: bool) -> bool:
    """Download a campaign; an error does not stop the other downloads."""
    try:
        download_results(kube, results, output, force=force)
    except StorageError as error:
        tell(message_of(error))
        return False
    return True


def download_results(
    kube: Kubernetes, results: Results, output: Path, *, force: bool = False, run: str | None = None
) -> Path:
    """Download a campaign, or one of its runs; return the folder of the campaign."""
    with open_store(kube, results.place) as store:
        if results.campaign is not None:
            if _has_not_begun(results.campaign) and not store.has_bucket(results.bucket):
                say(f"{results.campaign.name}: nothing is stored yet. Repeat the command later.")
                return output / results.name
            is_owned(store, results.bucket, results.campaign.uid)
        folder = folder_for(output, results.name, owner_of(store, results.bucket))
        if folder.name != results.name:
            say(f"The folder {results.name} belongs to another campaign. Using {folder.name}.")
        with Bars() as bars:
            view = _Shown(bars, folder.name)
            result = download_campaign(
                store, results.bucket, folder, view, force=force, run=run, imported=True
            )
    for line in _summary(result):
        say(line)
    if results.campaign is not None and results.campaign.status.decisions:
        say(f"{printable(results.campaign.status.decisions)}.")
    return folder


def _has_not_begun(campaign: CampaignState) -> bool:
    """Whether its bucket may not exist yet; the first pod creates it."""
    return not campaign.finished and not campaign.done


def _summary(result: DownloadResult) -> Iterator[str]:
    total = result.fetched + result.present
    here = f" ({result.present} already existed)" if result.present else ""
    yield f"{shown(result.campaign)}: {total} runs{here}, {fmt_size(result.size)} downloaded."
    if result.unfinished:
        yield f"{len(result.unfinished)} runs are not stored yet. Repeat the command later."
    if result.lacking:
        yield (
            f"{len(result.lacking)} runs have files that could not be stored. `missing` in their "
            f"run.json lists the files with reasons, for example in {result.lacking[0]}."
        )
    yield from result.warnings[:MOST_TOLD]
    if len(result.warnings) > MOST_TOLD:
        yield f"… and {len(result.warnings) - MOST_TOLD} more objects."


class _Shown:
    """A download as one bar."""

    def __init__(self, bars: Bars, title: str) -> None:
        self._bars = bars
        self._title = title
        self._size = self._count = self._received = self._files = 0

    def planned(self, files: int, size: int) -> None:
        """Set its length."""
        self._count, self._size = files, size
        self._show()

    def received(self, size: int) -> None:
        """Advance it."""
        self._received += size
        self._show()

    def file_finished(self) -> None:
        """Count a file."""
        self._files += 1
        self._show()

    def _show(self) -> None:
        note = f"{self._files}/{self._count} files"
        self._bars(self._title, self._received, self._size, note)
