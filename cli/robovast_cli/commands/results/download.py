"""`vast results download`: download from object storage or a file share, with progress bars."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from robovast.base.environment import environment
from robovast.base.errors import CannotRunError, InputError, StorageError, with_hint
from robovast.base.optional_deps import CLUSTER
from robovast.base.printable import printable
from robovast.base.sizes import fmt_size
from robovast.campaign.executables import warn_of_executables
from robovast.storage.bucket_ownership import is_owned, owner_of
from robovast.storage.folder_ownership import folder_for
from robovast.storage.shares.campaigns import (
    SHARE_TYPE,
    NotOnShareError,
    download_from_share,
    open_share,
)
from robovast_cli.commands.results.options import Target
from robovast_cli.kube.api import KubernetesClient, connect
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.kube.results import Results, named_results, stored_results
from robovast_cli.kube.status import campaign_states
from robovast_cli.kube.store import open_store
from robovast_cli.lazy import examples
from robovast_cli.ui.bars import Bars
from robovast_cli.ui.output import echo
from robovast_cli.ui.report import echo_stderr, message_of
from robovast_cli.ui.table import counted
from robovast_cli.workspace import shown

if TYPE_CHECKING:
    from robovast.storage.download import DownloadResult

MOST_WARNINGS = 20
"""Maximum number of warnings about objects that are skipped or stored under other paths."""


@examples(
    ("vast results download", "Download all campaigns"),
    ("vast results download -i hall-2026-03-04-152130 -o results", "Download one campaign"),
    ("vast results download --from share", "Download from the file share"),
)
def download(
    ctx: typer.Context,
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="Name of a campaign or of its results folder (default: all) (repeatable).",
        ),
    ] = None,
    output: Target = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Download existing files again.")
    ] = False,
    source: Annotated[
        Literal["cluster", "share"] | None,
        typer.Option(
            "--from",
            help="Source: object storage of the cluster, or file share (default: share if "
            "ROBOVAST_SHARE_TYPE is set without --context and --namespace, otherwise cluster).",
        ),
    ] = None,
    keep_archive: Annotated[
        bool, typer.Option("--keep-archive", help="Keep the downloaded `.tar.gz` file.")
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Log of HTTP requests with their status, on stderr.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Download results from object storage or a file share.

    Each run or archive is verified, and downloaded completely or not at all. Existing runs are
    skipped, so you can repeat the command while the campaign is running, after an interruption, or
    after more runs were added. A local campaign is not updated from the file share, unless
    `--force` replaces it.
    """
    if debug:
        logging.getLogger("urllib3").setLevel(logging.DEBUG)
    output = output or ctx.obj.results
    names = campaign or []
    cluster_is_meant = source == "cluster" or (source is None and (context or namespace))
    if source == "share" or (not cluster_is_meant and _has_share()):
        _download_shared(names, output, force=force, keep_archive=keep_archive)
        return
    CLUSTER.require("Access to a cluster")
    try:
        _download_campaigns(context, namespace, names, output, force=force)
    except CannotRunError as error:
        if cluster_is_meant:
            raise
        share = "to download from a file share, set ROBOVAST_SHARE_TYPE (or use a `.env` file)"
        raise CannotRunError(error.message, hint=with_hint(error.hint, share)) from error


def _has_share() -> bool:
    """Return whether the environment or a `.env` file describes a file share."""
    try:
        return bool(environment().get(SHARE_TYPE))
    except CannotRunError:  # the file cannot be read, but may concern other things
        return bool(os.environ.get(SHARE_TYPE))


def _download_shared(
    names: Sequence[str], output: Path, *, force: bool, keep_archive: bool
) -> None:
    """Download campaigns by name (default: all) from the file share; `force` replaces folders."""
    with open_share() as share, Bars() as progress:
        try:
            fetched, present = download_from_share(
                share, names, output, force=force, keep_archive=keep_archive, progress=progress
            )
        except NotOnShareError as error:
            hint = f"{error.hint}, or search the object storage with `--from cluster`"
            raise InputError(error.message, hint=hint) from error
    for folder in fetched:
        echo(f"{shown(folder)}: downloaded from the file share.")
        if warning := warn_of_executables(folder):
            echo(warning)
    for folder in present:
        echo(f"{shown(folder)}: already exists. `--force` downloads it again.")
    if not fetched and not present:
        echo("No campaigns on the file share.")


def _download_campaigns(
    context: str | None, namespace: str | None, names: Sequence[str], output: Path, *, force: bool
) -> None:
    """Download campaigns by name (default: all), with `force` also existing runs."""
    with connect(context, namespace) as kube:
        known = campaign_states(kube)
        chosen = (
            [named_results(kube, known, name) for name in names]
            if names
            else stored_results(kube, known)
        )
        failed = []
        for results in chosen:
            try:
                _download_results(kube, results, output, force=force)
            except StorageError as error:
                echo_stderr(message_of(error))
                failed.append(results.name)
    if failed:
        raise StorageError(
            f"incomplete download: {', '.join(failed)}.",
            hint="run the command again to download the rest",
        )


def download_run(context: str | None, namespace: str | None, run: str, output: Path) -> Path:
    """Download a run with the files that a replay needs; return its folder.

    Args:
        context: context of the kubeconfig (default: the current one).
        namespace: namespace of the campaign (default: from the context).
        run: `<campaign>/<configuration>/<number>`.
        output: folder for the campaign's folder.
    """
    name, _, path = run.partition("/")
    with connect(context, namespace) as kube:
        known = campaign_states(kube)
        folder = _download_results(kube, named_results(kube, known, name), output, run=path)
    return folder / path


def _download_results(
    kube: KubernetesClient,
    results: Results,
    output: Path,
    *,
    force: bool = False,
    run: str | None = None,
) -> Path:
    """Download a campaign, or one of its runs; return the folder of the campaign."""
    from robovast.storage.download import download_campaign

    with open_store(kube, results.place) as store:
        if (campaign := results.campaign) is not None:
            started = campaign.finished or campaign.done  # the first pod creates the bucket
            if not started and not store.has_bucket(results.bucket):
                echo(f"{campaign.name}: nothing is stored yet. Repeat the command later.")
                return output / results.name
            is_owned(store, results.bucket, campaign.uid)
        folder = folder_for(output, results.name, owner_of(store, results.bucket))
        if folder.name != results.name:
            echo(f"The folder {results.name} belongs to another campaign. Using {folder.name}.")
        with Bars() as bars:
            view = _ProgressBar(bars, folder.name)
            result = download_campaign(
                store, results.bucket, folder, view, force=force, run=run, imported=True
            )
    for line in _summary(result):
        echo(line)
    if campaign is not None and campaign.status.decisions:
        echo(f"{printable(campaign.status.decisions)}.")
    return folder


def _summary(result: DownloadResult) -> Iterator[str]:
    runs = counted(result.fetched + result.present, "run")
    here = f" ({result.present} already existed)" if result.present else ""
    yield f"{shown(result.campaign)}: {runs}{here}, {fmt_size(result.size)} downloaded."
    if result.unfinished:
        yield f"{len(result.unfinished)} runs are not stored yet. Repeat the command later."
    if result.lacking:
        yield (
            f"{len(result.lacking)} runs have files that could not be stored. `missing` in their "
            f"run.json lists the files with reasons, for example in {result.lacking[0]}."
        )
    yield from result.warnings[:MOST_WARNINGS]
    if len(result.warnings) > MOST_WARNINGS:
        yield f"… and {len(result.warnings) - MOST_WARNINGS} more objects."


class _ProgressBar:
    """Shows the progress of a download as one bar."""

    def __init__(self, bars: Bars, title: str) -> None:
        self._bars = bars
        self._title = title
        self._size = self._count = self._received = self._files = 0

    def planned(self, files: int, size: int) -> None:
        """Set the length of the bar."""
        self._count, self._size = files, size
        self._show()

    def received(self, size: int) -> None:
        """Advance the bar."""
        self._received += size
        self._show()

    def file_finished(self) -> None:
        """Count a file."""
        self._files += 1
        self._show()

    def _show(self) -> None:
        note = f"{self._files}/{self._count} files"
        self._bars(self._title, self._received, self._size, note)
