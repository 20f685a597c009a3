"""`python -m robovast.agent COMMAND`: what our containers in a campaign's pods do."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from robovast.agent.exit_codes import AgentExit
from robovast.agent.folders import Folders
from robovast.agent.messages import error_message, write_message
from robovast.errors import RobovastError, StorageError

INDEX = "JOB_COMPLETION_INDEX"
"""Variable that Kubernetes sets in the pods of an Indexed Job."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what the command line says; returns the exit code."""
    options = _parser().parse_args(arguments)
    given = {name: getattr(options, name) for name in Folders.__dataclass_fields__}
    folders = Folders(**{name: value for name, value in given.items() if value is not None})
    command: Callable[[Folders, argparse.Namespace], AgentExit] = options.command
    try:
        return command(folders, options)
    except (RobovastError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)  # noqa: T201
        write_message(folders.message, error_message(error))
        return _exit_code(error)


def _exit_code(error: Exception) -> AgentExit:
    from robovast.agent.campaign import PlanError

    if isinstance(error, PlanError):
        return AgentExit.BAD_PLAN
    if isinstance(error, OSError | StorageError):
        return AgentExit.STORAGE
    return AgentExit.BAD_DOCUMENT


def _fetch(folders: Folders, options: argparse.Namespace) -> AgentExit:
    from robovast.agent.fetch import Request, fetch

    request = Request(options.first_pack, options.index, options.attempt, options.runs)
    return fetch(folders, request)


def _agent(folders: Folders, options: argparse.Namespace) -> AgentExit:
    from robovast.agent.agent import agent

    del options
    return agent(folders)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m robovast.agent", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    fetch = _command(commands, "fetch", _fetch, "prepare the runs of a pod")
    fetch.add_argument("--first-pack", type=int, default=0, help="pack of completion index 0")
    fetch.add_argument(
        "--index", type=int, default=int(os.environ.get(INDEX, "0")), help="completion index"
    )
    fetch.add_argument("--attempt", type=int, default=1, help="which repetition it is, from 1")
    fetch.add_argument("--runs", help="ids of the runs to repeat, as `17,204-206`")
    _command(commands, "agent", _agent, "store the runs of a pod as they end")
    return parser


def _command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser],
    name: str,
    action: Callable[[Folders, argparse.Namespace], AgentExit],
    text: str,
) -> argparse.ArgumentParser:
    command = commands.add_parser(name, help=text)
    command.set_defaults(command=action)
    for folder in ("plan", "files", "credentials", "work", "message"):
        command.add_argument(f"--{folder}", type=Path, metavar="PATH")
    for seen in ("config-seen", "out-seen"):
        command.add_argument(f"--{seen}", metavar="PATH", help="as runs see it")
    return command


if __name__ == "__main__":
    raise SystemExit(main())
