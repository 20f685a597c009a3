"""`vast results download`: from the cluster's storage, or from the share."""

from __future__ import annotations

import logging
import os
from typing import Annotated, Literal

import typer

from robovast_cli.commands.results.options import Target
from robovast_cli.kube.options import Context, Namespace
from robovast_cli.lazy import new_app

app = new_app("Download results from the cluster's storage, or from the share.")


@app.command()
def download(
    ctx: typer.Context,
    campaign: Annotated[
        list[str] | None,
        typer.Option(
            "-i",
            "--campaign",
            metavar="NAME",
            help="Only this campaign: its name, or that of its results folder. May be repeated; "
            "all when omitted.",
            show_default=False,
        ),
    ] = None,
    output: Target = None,
    force: Annotated[
        bool, typer.Option("-f", "--force", help="Download everything, including existing files.")
    ] = False,
    source: Annotated[
        Literal["cluster", "share"] | None,
        typer.Option(
            "--from",
            help="Where from; the share where ROBOVAST_SHARE_TYPE is set and neither a context "
            "nor a namespace is given, else the cluster's storage.",
            show_default=False,
        ),
    ] = None,
    keep_archive: Annotated[
        bool,
        typer.Option("--keep-archive", help="Also leave the `.tar.gz` that came from the share."),
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Print each HTTP request and its status on stderr.")
    ] = False,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Download results: verified, each run or archive completely or not at all.

    What is here already is not fetched again, so that it can be repeated at any time: while the
    campaign runs, after an interruption, after more runs were added. From the share, a campaign
    that is here stays as it is, unless `--force` replaces it.
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
            f"{error} A share is not set either: ROBOVAST_SHARE_TYPE in the environment, or in a "
            "`.env` file, would name it."
        ) from error


def has_share() -> bool:
    """True when a share is described, in the environment or a `.env` file."""
    from robovast.base.environment import environment
    from robovast.base.errors import CannotRunError
    from robovast.storage.shares.campaigns import SHARE_TYPE

    try:
        return bool(environment().get(SHARE_TYPE))
    except CannotRunError:  # the file cannot be read, but may concern other things
        return bool(os.environ.get(SHARE_TYPE))
