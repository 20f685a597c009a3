"""`vast view`: play back the recording of a run in the browser."""

from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Annotated
from urllib.parse import quote

import typer

from robovast.base.errors import ExitCode, InputError
from robovast.base.optional_deps import ROS
from robovast.model.naming import is_run_number
from robovast_cli.commands.evaluation.gui import (
    NoBrowser,
    Port,
    import_server,
    make_starting,
    show_page,
)
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo

PLAYER = "robovast.evaluation.drive.drives"


@examples(
    ("vast view results/hall-2026-03-04-152130/hall-1/0", "Play back in the web UI"),
    ("vast view results/hall-2026-03-04-152130/hall-1/0 --rerun", "Play back in Rerun"),
)
def view(
    ctx: typer.Context,
    run: Annotated[
        Path,
        typer.Argument(
            metavar="RUN", help="Folder of a run: <results>/<campaign>/<configuration>/<number>."
        ),
    ],
    rerun: Annotated[
        bool, typer.Option("--rerun", help="Show the recording in Rerun (extra `rerun`).")
    ] = False,
    foxglove: Annotated[
        bool,
        typer.Option(
            "--foxglove",
            help="Serve the recording to Lichtblick or Foxglove and print the address.",
        ),
    ] = False,
    port: Port = None,
    no_browser: NoBrowser = False,
) -> int:
    """Play back the recording of a run.

    Shows map, robot, laser scan, paths and events on one timeline. The web UI is available only
    on this machine, at an address with a secret. Nothing is postprocessed. Press Ctrl-C to stop.
    """
    if rerun and foxglove:
        raise InputError("`--rerun` and `--foxglove` exclude each other", hint="use one of them")
    serve = import_server()
    from robovast.evaluation.library import Library

    ROS.require("Playing a drive")
    results, names = _locate_run(run)
    if rerun:
        _show_in_rerun(run, results, names, port, no_browser)
        return ExitCode.OK
    if foxglove:
        _serve_to_foxglove(run, results, names, port)
        return ExitCode.OK
    Thread(target=import_module, args=[PLAYER], daemon=True).start()  # while the browser starts
    address = "/".join(map(quote, names))
    serve(
        Library(results),
        port,
        lambda page: show_page(
            run, f"{page}#/campaign/{address}?tab=player", no_browser=no_browser
        ),
        starting=make_starting(ctx.obj, None, False, False),
    )
    return ExitCode.OK


def _show_in_rerun(
    run: Path, results: Path, names: tuple[str, ...], port: int | None, no_browser: bool
) -> None:
    from robovast.evaluation.server.other_viewers import open_in_rerun

    def ready(address: str, problems: list[str]) -> None:
        _echo_problems(problems)
        show_page(run, address, no_browser=no_browser)

    open_in_rerun(results, _bag(results, names), "-".join(names[1:]), port, ready)


def _serve_to_foxglove(run: Path, results: Path, names: tuple[str, ...], port: int | None) -> None:
    from robovast.evaluation.server.other_viewers import serve_mcap

    def ready(address: str, problems: list[str]) -> None:
        _echo_problems(problems)
        echo(f"Serving {run}: {address}")
        link = f"lichtblick://open?ds=remote-file&ds.url={quote(address, safe='')}"
        echo(f"  Lichtblick: lichtblick '{link}'")
        echo("  Foxglove, or Lichtblick in a browser: Open connection > Remote file > this address")

    name = "-".join(names[1:]) + ".mcap"
    serve_mcap(results, _bag(results, names), name, port, ready)


def _bag(results: Path, names: tuple[str, ...]) -> str:
    from robovast.evaluation.drive.bag_discovery import bag_of, read_named
    from robovast.evaluation.notebooks.workloads import Target

    named = read_named(Target(results, names[:1]))
    return bag_of(results, "/".join(names), named)


def _echo_problems(problems: list[str]) -> None:
    for problem in problems:
        echo(f"Incomplete: {problem}")


def _locate_run(path: Path) -> tuple[Path, tuple[str, ...]]:
    """Return the results folder of a run, and its campaign, configuration and number.

    Raises:
        InputError: the folder does not exist, is not a run, or has no bag.
    """
    from robovast.evaluation.drive.bag_discovery import bags_in
    from robovast.evaluation.files import list_files
    from robovast.evaluation.notebooks.workloads import target_of

    if not path.is_dir():
        raise InputError(
            f"the folder {path} does not exist.",
            hint="name the folder of a run, for example results/hall-2026-03-04-152130/hall-1/0",
        )
    target = target_of(path)
    names = target.names[:3]
    if len(names) < 3 or not is_run_number(names[2]):
        raise InputError(
            f"{path} is {'the folder of a campaign' if len(names) == 1 else 'not a run folder'}",
            hint="name the folder of a run, <campaign>/<configuration>/<number>. `vast evaluation "
            "gui -r` shows all runs of a campaign",
        )
    if not bags_in(list_files(target.results, "/".join(names))):
        raise InputError(
            f"{path} has no recording: no folder contains .mcap or .db3 files",
            hint="record a bag to the output folder in the scenario",
        )
    return target.results, names
