"""Executes plugins in a separate process, so that hangs, crashes and exits affect nothing else.

    python -m robovast.analysis.postprocessing.child DESCRIPTOR

reads requests from stdin and writes replies to the descriptor, both as lines of JSON. Output of
plugins goes to stderr.
"""

from __future__ import annotations

import inspect
import json
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from robovast.analysis.postprocessing.guard import WriteGuard
from robovast.analysis.postprocessing.outcome import (
    CommandOutcome,
    NonsenseError,
    read_entries,
    read_returned,
)
from robovast.base.errors import InputError, RobovastError
from robovast.base.plugins import load_plugin, raised
from robovast.base.safe_paths import read_file
from robovast.model.document.commands import GROUP, BagCommand, bag_command

GIVEN = ("provenance_file", "execution_image", "debug", "force")
"""Arguments that a plugin receives besides its parameters, if it accepts them."""

Plugin = Callable[..., Any]


def main() -> None:
    """Answer requests until stdin ends."""
    replies = os.fdopen(int(sys.argv[1]), "w", encoding="utf-8")
    requests = os.fdopen(os.dup(0), encoding="utf-8")
    os.dup2(2, 1)  # keep plugins' output apart from the replies
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    guard = WriteGuard()
    guard.install()
    _answer(requests, replies, guard)


def _answer(requests: TextIO, replies: TextIO, guard: WriteGuard) -> None:
    _say(replies, "ready")
    for line in requests:
        _say(replies, _reply(json.loads(line), guard))


def _say(replies: TextIO, value: Any) -> None:
    replies.write(json.dumps(value, default=str) + "\n")
    replies.flush()


def _reply(request: Mapping[str, Any], guard: WriteGuard) -> Any:
    if request["ask"] == "per_run":
        return is_per_run(request)
    if request["ask"] == "bags":
        return [outcome.plain() for outcome in convert_bags(request["calls"])]
    return _with_remedy(call(request, guard), request["folder"]).plain()


def _with_remedy(outcome: CommandOutcome, folder: str) -> CommandOutcome:
    """Add a remedy to a failure that names a missing file next to the campaign's .vast file."""
    named = re.findall(rf"{re.escape(folder)}/([^\s'\":,;()]+)", outcome.message)
    missing = [name for name in named if not os.path.exists(Path(folder, name))]
    if outcome.success or not missing:
        return outcome
    remedy = (
        f"{outcome.message}. Add `{missing[0]}` to `execution.run_files`, so that each campaign "
        "keeps the file. For campaigns that lack it, name the .vast file that has it next to it: "
        "`vast results postprocess --override FILE`."
    )
    return replace(outcome, message=remedy)


def is_per_run(request: Mapping[str, Any]) -> bool:
    """Whether a plugin wants to be called for each run; False if it cannot be loaded."""
    try:
        return bool(getattr(_load(request), "per_run", False))
    except RobovastError:
        return False


def call(request: Mapping[str, Any], guard: WriteGuard) -> CommandOutcome:
    """Call a plugin; all its errors become outcomes.

    Args:
        request: `name`, `parameters`, `folder` (of the .vast file), `results_dir`, `campaign`
            and `scratch`, a temporary folder of this process.
        guard: restricts the plugin's writes.
    """
    try:
        return _guarded(request, guard)
    except (RobovastError, NonsenseError) as error:
        return CommandOutcome(False, str(error))
    except SystemExit as error:
        return CommandOutcome(False, f"called `sys.exit({error.code!r})` instead of returning")
    except Exception as error:
        traceback.print_exc()
        if guard.refused:
            return CommandOutcome(False, f"must not write {guard.refused}: {_OUTSIDE}")
        return CommandOutcome(False, f"raised {raised(error)}")
    finally:
        guard.allow_all()


def convert_bags(calls: Sequence[Mapping[str, Any]]) -> list[CommandOutcome]:
    """Execute several bag commands in one pass over each bag of a run.

    Args:
        calls: requests that differ only in `name` and `parameters`.
    """
    try:
        return _convert_bags(calls)
    except RobovastError as error:
        return [CommandOutcome(False, str(error)) for _ in calls]
    except Exception as error:
        traceback.print_exc()
        text = f"raised {raised(error)}"
        return [CommandOutcome(False, text) for _ in calls]


def _convert_bags(calls: Sequence[Mapping[str, Any]]) -> list[CommandOutcome]:
    from robovast.analysis.bags.convert import convert_run

    run, campaign = Path(calls[0]["results_dir"]), Path(calls[0]["campaign"])
    jobs = [bag_command(call["name"], call["parameters"]) for call in calls]
    done = convert_run(run, jobs, Path(calls[0]["folder"]))
    entries = read_entries(done.provenance(run), "", run, campaign)
    outcomes = []
    for number, (job, call) in enumerate(zip(jobs, calls, strict=True)):
        # Remarks on a whole bag are reported once.
        about: list[BagCommand | None] = [None, job] if number == 0 else [job]
        said = "" if call["quiet"] else "\n".join(t for of, t in done.remarks if of in about)
        failure = done.failures.get(job)
        outcomes.append(CommandOutcome(failure is None, failure or said))
    return [replace(outcomes[0], entries=entries), *outcomes[1:]]


_OUTSIDE = "it is outside of the campaign; results belong below `results_dir`"


def _guarded(request: Mapping[str, Any], guard: WriteGuard) -> CommandOutcome:
    campaign, results = Path(request["campaign"]), Path(request["results_dir"])
    plugin = _load(request)
    scratch = Path(request["scratch"])
    provenance = scratch / "provenance.json"
    provenance.unlink(missing_ok=True)
    prepared = prepare(plugin, request, provenance)
    guard.allow(campaign, [scratch, *_named_folders(request)])
    returned = prepared()
    guard.allow_all()
    outcome = read_returned(returned, request["name"], results, campaign)
    entries = _file_entries(provenance, request["name"], results, campaign)
    if guard.refused:
        return CommandOutcome(False, f"must not write {guard.refused}: {_OUTSIDE}")
    return CommandOutcome(outcome.success, outcome.message, outcome.entries + entries)


def _load(request: Mapping[str, Any]) -> Any:
    return load_plugin(request["name"], GROUP, request["folder"])


def prepare(plugin: Any, request: Mapping[str, Any], provenance: Path) -> Callable[[], Any]:
    """Bind a plugin's parameters after comparing them with its signature.

    Classes are instantiated, with the parameters if the constructor takes any.

    Raises:
        InputError: the parameters do not match; the message lists the valid ones.
    """
    parameters = dict(request["parameters"])
    if inspect.isclass(plugin):
        own = _signature(plugin)
        given = parameters if own.parameters else {}
        parameters = {} if given else parameters
        plugin = _bound(plugin, own, (), given)()
    if not callable(plugin):
        raise InputError(
            f"is a {type(plugin).__name__}, which cannot be called", hint="write a function"
        )
    signature = _signature(plugin)
    for name, value in {"provenance_file": str(provenance), **request["given"]}.items():
        if _takes(signature, name):
            parameters.setdefault(name, value)
    return _bound(plugin, signature, (request["results_dir"], request["folder"]), parameters)


def _signature(plugin: Plugin) -> inspect.Signature:
    try:
        return inspect.signature(plugin)
    except (TypeError, ValueError) as error:
        raise InputError(f"cannot be called: {error}") from error


def _takes(signature: inspect.Signature, name: str) -> bool:
    kinds = (parameter.kind for parameter in signature.parameters.values())
    return name in signature.parameters or inspect.Parameter.VAR_KEYWORD in kinds


def _bound(
    plugin: Plugin, signature: inspect.Signature, folders: tuple[str, ...], parameters: Any
) -> Callable[[], Any]:
    try:
        signature.bind(*folders, **parameters)
    except TypeError as error:
        names = [name for name in signature.parameters if name not in GIVEN]
        own = ", ".join(f"`{name}`" for name in names[len(folders) :]) or "none"
        raise InputError(f"{error}", hint=f"use its parameters: {own}") from error
    return lambda: plugin(*folders, **parameters)


def _named_folders(request: Mapping[str, Any]) -> Iterator[Path]:
    """Folders named in the user's parameters, where the plugin may therefore write."""
    for value in request["parameters"].values():
        if isinstance(value, str):
            folder = Path(request["folder"], value)
            if "/" in value or os.path.isdir(folder):
                yield folder


def _file_entries(path: Path, plugin: str, base: Path, campaign: Path) -> list[dict[str, Any]]:
    """Provenance entries that a script wrote to a file."""
    if not os.path.exists(path):
        return []
    try:
        data = json.loads(read_file(path))
    except (OSError, ValueError) as error:
        raise NonsenseError(f"its provenance file is not JSON: {error}") from error
    if not isinstance(data, dict):
        raise NonsenseError("its provenance file has no `entries`")
    return read_entries(data.get("entries"), plugin, base, campaign)


if __name__ == "__main__":
    main()
