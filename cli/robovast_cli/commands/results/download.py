"""`vast results download`: from object storage, or from the file share."""

from __future__ import annotations

import logging
import os
from typing import Annotated, Literal

import typer

from robovast_cli.commands.results.options import Target
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import examples, new_app

app = new_app("Download results from object storage or a file share.")


@app.command()
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
            show_default=False,
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
            show_default=False,
        ),
    ] = None,
    keep_archive: Annotated[
        bool,
        typer.Option("--keep-archive", help="Keep the downloaded `.tar.gz` file."),
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
    if source == "share" or (not cluster_is_meant and has_share()):
        from robovast_cli.commands.results.share_download import download_shared

        download_shared(names, output, force=force, keep_archive=keep_archive)
        return
    from robovast.base.errors import CannotRunError
    from robovast.base.optional_deps import CLUSTER

    with CLUSTER.needed_by("Access to a cluster"):
        from robovast_cli.commands.results.downloading import download_campaigns

    try:
        download_campaigns(context, namespace, names, output, force=force)
    except CannotRunError as error:
        if cluster_is_meant:
            raise
        raise CannotRunError(
            error.message,
            hint=f"{error.hint}. To download from a file share, set ROBOVAST_SHARE_TYPE in the "
            "environment or in a `.env` file".removeprefix(". "),
        ) from error


def has_share() -> bool:
    """Return whether the environment or a `.env` file describes a file share."""
    from robovast.base.environment import environment
    from robovast.base.errors import CannotRunError
    from robovast.storage.shares.campaigns import SHARE_TYPE

    try:
        return bool(environment().get(SHARE_TYPE))
    except CannotRunError:  # the file cannot be read, but may concern other things
        return bool(os.environ.get(SHARE_TYPE))
