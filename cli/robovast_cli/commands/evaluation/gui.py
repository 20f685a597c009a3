"""`vast evaluation gui`: the web UI."""

import os
import sys
import webbrowser
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from robovast.base.errors import ExitCode, InputError
from robovast.base.optional_deps import GUI
from robovast_cli.commands.results.buckets import Bucket, Context, Namespace, open_campaigns
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo
from robovast_cli.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Callable

    from robovast.evaluation.server.launches import Starting
    from robovast.evaluation.server.preparing import Preparation


NO_START = (
    "This web UI only shows results (`--no-start`). To run a campaign, use `vast exec local run` "
    "on your machine or `vast exec cluster run` on a cluster."
)
IN_BUCKET = "This web UI only shows a campaign in a bucket (`--bucket`)."

Port = Annotated[
    int | None,
    typer.Option(
        "-p",
        "--port",
        min=1,
        max=65535,
        help="Local port, for example to forward it over SSH (default: a free port).",
    ),
]
NoBrowser = Annotated[
    bool, typer.Option("--no-browser", help="Print the address without opening a browser.")
]


@examples(
    ("vast evaluation gui -r results", "Show all campaigns in results"),
    ("vast evaluation gui --bucket hall-2026-03-04-152130", "Show a campaign in its bucket"),
)
def gui(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    force: Annotated[
        bool,
        typer.Option(
            "-f", "--force", help="Postprocess all results again, even if they have not changed."
        ),
    ] = False,
    skip_postprocessing: Annotated[
        bool,
        typer.Option(
            "--skip-postprocessing",
            help="Show the results as they are, without running commands of .vast files.",
        ),
    ] = False,
    override: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--override",
            metavar="VAST_FILE",
            help="Use commands and notebooks of this .vast file (default: each campaign's own).",
        ),
    ] = None,
    port: Port = None,
    notebook_timeout: Annotated[
        float,
        typer.Option(
            "--notebook-timeout",
            metavar="SECONDS",
            min=1,
            help="Time limit of a notebook in seconds.",
        ),
    ] = 600,
    no_browser: NoBrowser = False,
    no_start: Annotated[
        bool, typer.Option("--no-start", help="Do not allow starting campaigns in the web UI.")
    ] = False,
    bucket: Bucket = None,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Start the web UI.

    The web UI opens immediately and also shows running campaigns. Meanwhile, it postprocesses
    results like `vast results postprocess`, which runs the commands that .vast files name. The
    web UI is available only on this machine, at an address with a secret. Press Ctrl-C to stop.

    With --bucket, the web UI shows a finished campaign in its bucket. It reads the tables of the
    campaign, and downloads the files of a run to a temporary folder when you open the run.
    Nothing is postprocessed or started.
    """
    serve = import_server()
    if bucket is not None:
        if results_dir is not None:
            raise InputError(
                "`-r` (a folder) and `--bucket` exclude each other", hint="use one of them"
            )
        _show_bucket(serve, bucket, context, namespace, port, no_browser)
        return ExitCode.OK
    from robovast.evaluation.library import Library
    from robovast.model.naming import holds_campaign

    folder = results_dir or ctx.obj.results
    root = folder.resolve()
    campaign = root.name if holds_campaign(root) else ""

    def show(address: str) -> None:
        page = f"{address}#/campaign/{quote(campaign)}" if campaign else address
        show_page(folder, page, no_browser=no_browser)

    serve(
        Library(root.parent if campaign else root),
        port,
        show,
        starting=make_starting(ctx.obj, override, no_start, not skip_postprocessing),
        override=override and override.absolute(),
        notebook_timeout=notebook_timeout,
        preparation=None if skip_postprocessing else _preparation(folder, force, override),
    )
    return ExitCode.OK


def _show_bucket(
    serve: "Callable[..., None]",
    name: str,
    context: str | None,
    namespace: str | None,
    port: int | None,
    no_browser: bool,
) -> None:
    from robovast.evaluation.bucket_library import BucketLibrary, StoredCampaign
    from robovast.evaluation.server.launches import Starting

    with open_campaigns([name], context, namespace) as (found,):
        campaign = StoredCampaign(found.store, found.bucket, found.campaign, found.tables())
        library = BucketLibrary(campaign, found.scratch / "page")

        def show(address: str) -> None:
            page = f"{address}#/campaign/{quote(found.campaign)}"
            show_page(library.place, page, no_browser=no_browser)

        serve(library, port, show, starting=Starting([], None, IN_BUCKET, False, echo))


def import_server() -> "Callable[..., None]":
    """Return the function that serves the web UI.

    Raises:
        CannotRunError: the extra `gui` is missing.
    """
    with GUI.needed_by("The web UI"):
        from robovast.evaluation.server.serve import serve
    return serve


def show_page(folder: Path | str, page: str, *, no_browser: bool) -> None:
    """Print the address of a page about a folder or bucket, and open it if there is a display."""
    echo(f"Showing {folder}: {page}")
    if not no_browser and (os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"}):
        Thread(target=webbrowser.open, args=(page,), daemon=True).start()  # some block


def make_starting(
    workspace: Workspace, override: Path | None, no_start: bool, postprocess: bool
) -> "Starting":
    """Return how to start campaigns, with the .vast file of `override`, else of the project."""
    from robovast.evaluation.server.launches import Starting

    program = _program()
    document, refusal = override, ""
    if no_start:
        program, document, refusal = [], None, NO_START
    elif document is None:
        try:
            document = workspace.path
        except InputError as error:
            refusal = f"No campaign can be started in the web UI: {error}"
    absolute = None if document is None else document.absolute()
    return Starting(program, absolute, refusal, postprocess, echo)


def _program() -> list[str]:
    """Return the command line of `vast`, which no module in the current folder can replace."""
    return [sys.executable, "-P", "-m", "robovast_cli"]


def _preparation(folder: Path, force: bool, override: Path | None) -> "Preparation":
    """Return the command that updates the tables; if it fails, the web UI shows old tables."""
    from robovast.evaluation.campaigns import find_campaigns
    from robovast.evaluation.server.preparing import Preparation
    from robovast.model.naming import holds_campaign

    root = folder.resolve()
    found = [root] if holds_campaign(root) else [root / name for name in find_campaigns(root)]
    command = [*_program(), "results", "postprocess", "-r", str(folder)]
    command += ["--force"] if force else []
    command += ["--override", str(override)] if override else []
    return Preparation(command, found, echo)
