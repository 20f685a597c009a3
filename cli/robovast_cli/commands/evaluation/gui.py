"""`vast evaluation gui`: results in the browser."""

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
from robovast_cli.commands.results.buckets import Bucket, Context, Namespace
from robovast_cli.commands.results.options import ResultsDir
from robovast_cli.lazy import new_app
from robovast_cli.ui.output import say
from robovast_cli.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Callable

    from robovast.evaluation.server.launches import Starting
    from robovast.evaluation.server.preparing import Preparation

app = new_app("Look at results in the browser.")

NO_START = (
    "This page only shows results (`--no-start`). On your machine, `vast exec local run` runs a "
    "campaign there and `vast exec cluster run` one in a cluster."
)
IN_BUCKET = "This page only shows a campaign in a bucket (`--bucket`)."

Port = Annotated[
    int | None,
    typer.Option(
        "-p",
        "--port",
        min=1,
        max=65535,
        help="Port on this machine, to forward it over SSH; any free one when omitted.",
        show_default=False,
    ),
]
NoBrowser = Annotated[
    bool, typer.Option("--no-browser", help="Print the address only, open no browser.")
]


@app.command()
def gui(
    ctx: typer.Context,
    results_dir: ResultsDir = None,
    force: Annotated[
        bool,
        typer.Option("-f", "--force", help="Postprocess everything again, changed or not."),
    ] = False,
    skip_postprocessing: Annotated[
        bool,
        typer.Option(
            "--skip-postprocessing",
            help="Show the results as they are; execute no command that a campaign names.",
        ),
    ] = False,
    override: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--override",
            metavar="VAST_FILE",
            help="Use the commands and notebooks of this file for every campaign, not its own.",
            show_default=False,
        ),
    ] = None,
    port: Port = None,
    notebook_timeout: Annotated[
        float,
        typer.Option(
            "--notebook-timeout",
            metavar="SECONDS",
            min=1,
            help="Stop a notebook that takes longer.",
        ),
    ] = 600,
    no_browser: NoBrowser = False,
    no_start: Annotated[
        bool, typer.Option("--no-start", help="Let no campaign be started from the page.")
    ] = False,
    bucket: Bucket = None,
    context: Context = None,
    namespace: Namespace = None,
) -> int:
    """Look at results in the browser, those of a campaign that is still running too.

    The page is there at once; meanwhile the results are postprocessed, as `vast results
    postprocess` does: that executes what their .vast files name. The page answers on this machine
    only, at an address that holds a secret. Ctrl-C ends it.

    With --bucket the page shows a campaign where it is stored, when all its runs have ended: its
    runs are read from its tables, and the files of a run are fetched when it is opened, into a
    folder that is removed at the end. Nothing is postprocessed or started.
    """
    serve = serving()
    if bucket is not None:
        if results_dir is not None:
            raise InputError("name one: `-r` is a folder here, `--bucket NAME` is in a bucket.")
        _show_bucket(serve, bucket, context, namespace, port, no_browser)
        return ExitCode.OK
    from robovast.evaluation.library import Library
    from robovast.model.naming import holds_campaign

    folder = results_dir or ctx.obj.results
    root = folder.resolve()
    campaign = root.name if holds_campaign(root) else ""

    def show(address: str) -> None:
        page = f"{address}#/campaign/{quote(campaign)}" if campaign else address
        present(folder, page, no_browser=no_browser)

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
    from robovast_cli.commands.results.buckets import opened

    with opened([name], context, namespace) as (found,):
        campaign = StoredCampaign(found.store, found.bucket, found.campaign, found.tables())
        library = BucketLibrary(campaign, found.scratch / "page")

        def show(address: str) -> None:
            page = f"{address}#/campaign/{quote(found.campaign)}"
            present(library.place, page, no_browser=no_browser)

        serve(library, port, show, starting=Starting([], None, IN_BUCKET, False, say))


def serving() -> "Callable[..., None]":
    """The function that serves the page.

    Raises:
        CannotRunError: the extra `gui` is missing.
    """
    with GUI.needed_by("The web UI"):
        from robovast.evaluation.server.serve import serve
    return serve


def present(folder: Path | str, page: str, *, no_browser: bool) -> None:
    """Print the address of a page that shows a folder or bucket, and open it where there is a
    screen."""
    say(f"Showing {folder}: {page}")
    if not no_browser and (os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"}):
        Thread(target=webbrowser.open, args=(page,), daemon=True).start()  # some block


def make_starting(
    workspace: Workspace, override: Path | None, no_start: bool, postprocess: bool
) -> "Starting":
    """The document for campaigns started from the page: the override's or the project's."""
    from robovast.evaluation.server.launches import Starting

    program = _program()
    document, refusal = override, ""
    if no_start:
        program, document, refusal = [], None, NO_START
    elif document is None:
        try:
            document = workspace.path
        except InputError as error:
            refusal = f"No campaign can be started from the page: {error}"
    absolute = None if document is None else document.absolute()
    return Starting(program, absolute, refusal, postprocess, say)


def _program() -> list[str]:
    """The command line of `vast`; no module of this folder takes its place."""
    return [sys.executable, "-P", "-m", "robovast_cli"]


def _preparation(folder: Path, force: bool, override: Path | None) -> "Preparation":
    """Updates the tables; if that fails, it is reported and the page shows what exists."""
    from robovast.evaluation.campaigns import find_campaigns
    from robovast.evaluation.server.preparing import Preparation
    from robovast.model.naming import holds_campaign

    root = folder.resolve()
    found = [root] if holds_campaign(root) else [root / name for name in find_campaigns(root)]
    words = [*_program(), "results", "postprocess", "-r", str(folder)]
    words += ["--force"] if force else []
    words += ["--override", str(override)] if override else []
    return Preparation(words, found, say)
