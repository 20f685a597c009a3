"""`vast view`: what a run has recorded, played in the browser."""

from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Annotated
from urllib.parse import quote

import typer

from robovast.base.errors import ExitCode, InputError
from robovast.base.optional_deps import ROS
from robovast_cli.commands.evaluation.gui import make_starting, present, serving
from robovast_cli.lazy import new_app

PLAYER = "robovast.evaluation.drive.drives"

app = new_app("Play what a run has recorded.")


@app.command()
def view(
    ctx: typer.Context,
    run: Annotated[
        Path,
        typer.Argument(
            metavar="RUN", help="Folder of a run: <results>/<campaign>/<configuration>/<number>."
        ),
    ],
    port: Annotated[
        int | None,
        typer.Option(
            "-p",
            "--port",
            min=1,
            max=65535,
            help="Port on this machine, to forward it over SSH; any free one when omitted.",
            show_default=False,
        ),
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address only, open no browser.")
    ] = False,
) -> int:
    """Play what a run has recorded: map, robot, laser, paths and events on one time line.

    The page answers on this machine only, at an address that holds a secret. Nothing is
    postprocessed. Ctrl-C ends it.
    """
    serve = serving()
    ROS.require("Playing a drive")
    results, names = _place(run)
    Thread(target=import_module, args=[PLAYER], daemon=True).start()  # while the browser starts
    address = "/".join(map(quote, names))
    serve(
        results,
        port,
        lambda page: present(run, f"{page}#/campaign/{address}?tab=player", no_browser=no_browser),
        starting=make_starting(ctx.obj, None, False, False),
    )
    return ExitCode.OK


def _place(path: Path) -> tuple[Path, tuple[str, ...]]:
    """Results folder of a run; names of its campaign and configuration, and its number.

    Raises:
        InputError: the folder is missing, that of no run, or that of one without a bag.
    """
    from robovast.evaluation.drive.finding import bags_in
    from robovast.evaluation.files import list_files
    from robovast.evaluation.notebooks.workloads import target_of

    if not path.is_dir():
        raise InputError(f"There is no folder {path}.")
    target = target_of(path)
    names = target.names[:3]
    if len(names) < 3 or not names[2].isdigit():
        raise InputError(
            f"{path} is the folder of {'a campaign' if len(names) == 1 else 'no run'}; name that "
            "of a run, <campaign>/<configuration>/<number>. `vast evaluation gui -r` shows all "
            "of a campaign."
        )
    if not bags_in(list_files(target.results, "/".join(names))):
        raise InputError(
            f"{path} has no recording: no folder with .mcap or .db3 files. A run is played if its "
            "scenario records a bag to the output folder."
        )
    return target.results, names
