"""`python -m robovast.agent COMMAND`: the commands of our containers in a campaign's pods."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from robovast.agent import quick_start  # isort: skip  # before all others
from robovast.agent.mounts import Folders
from robovast.agent.reporting import run_and_report
from robovast.kubeapi.pod_contract.mounts import Mount
from robovast.kubeapi.pod_contract.pack_request import (
    ATTEMPT,
    FIRST_PACK,
    ONLY,
    REPEAT,
    PackRequest,
)
from robovast.storage.endpoint import Endpoint

INDEX = "JOB_COMPLETION_INDEX"
"""Variable that Kubernetes sets in the pods of an Indexed Job."""

_COMMANDS = {
    "agent": "prepare the runs of a pod, and store them as they end",
    "hold": "prepare the run of a pod and keep it alive, and store nothing",
    "compose": "expand a .vast file and store the inputs of its pods",
    "propose": "score the runs of a search and propose the next runs",
    "finish": "complete a campaign's results and sum them up",
    "process": "work a campaign's results up: tables, metadata, provenance",
    "purge": "remove a campaign's results",
    "notify": "send a notification about a campaign",
    "share": "pack a campaign's results and upload them to a share",
}
"""Each command is a function in the module of the same name."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command of the command line; return the exit code."""
    options = _parse(sys.argv[1:] if arguments is None else arguments)
    given = {name: getattr(options, name) for name in Folders.__dataclass_fields__}
    folders = Folders(**{name: value for name, value in given.items() if value is not None})
    as_json = options.command in {"agent", "compose", "propose"}
    return run_and_report(lambda: _carry_out(options, folders), folders.message, as_json=as_json)


def _carry_out(options: argparse.Namespace, folders: Folders) -> int:
    module = quick_start.load(f"robovast.agent.{options.command}")
    arguments: list[object] = [folders]
    index = int(os.environ.get(INDEX, "0"))
    if options.command == "agent":
        request = PackRequest(options.first_pack, index, options.attempt, options.repeat)
        arguments += [request, options.silence]
    elif options.command == "hold":
        arguments.append(PackRequest(0, run=options.run))
    elif options.command == "notify":
        arguments.append(index)
    elif options.command == "share":
        place = Endpoint.parse(options.endpoint, options.region)
        arguments.append(module.ShareRequest(options.campaign, options.bucket, place, options.uid))
    code: int = getattr(module, options.command)(*arguments)
    return code


def _parse(arguments: Sequence[str]) -> argparse.Namespace:
    """The options; only the parser of the command that is asked is made, if it is one."""
    asked = arguments[0] if arguments and arguments[0] in _COMMANDS else None
    return _parser([asked] if asked else list(_COMMANDS)).parse_args(arguments)


def _parser(names: Sequence[str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m robovast.agent", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    for name in names:
        text = _COMMANDS[name]
        command = commands.add_parser(name, help=text, description=text)
        for folder in (*Mount, "message"):
            command.add_argument(f"--{folder}", type=Path, metavar="PATH")
        for seen in ("config-seen", "out-seen"):
            command.add_argument(f"--{seen}", metavar="PATH", help="as runs see it")
        if name == "agent":
            _add_runs(command)
            silence = "seconds without log output after which a run is reported"
            command.add_argument("--silence", type=float, default=0.0, metavar="S", help=silence)
        elif name == "hold":
            command.add_argument(ONLY, type=int, required=True, help="id of the run")
        elif name == "share":
            _add_results(command)
    return parser


def _add_runs(agent: argparse.ArgumentParser) -> None:
    agent.add_argument(FIRST_PACK, type=int, default=0, help=f"the pack or group of ${INDEX} 0")
    agent.add_argument(ATTEMPT, type=int, default=1, help="which repetition it is, from 1")
    agent.add_argument(REPEAT, help="name of the list of runs that are repeated")


def _add_results(share: argparse.ArgumentParser) -> None:
    share.add_argument("--campaign", required=True, help="name of its results folder")
    share.add_argument("--bucket", required=True, help="where its results are")
    share.add_argument("--endpoint", required=True, help="URL of the S3 server")
    share.add_argument("--region", help="of the S3 server, where it has any")
    share.add_argument("--uid", help="of the Campaign that the bucket must be of")


if __name__ == "__main__":
    quick_start.end(main())
