"""The commands in a campaign's .vast file, each with a key that changes when its result may."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, ValidationError

from robovast.analysis.postprocessing.content import digests, file_digest, scan
from robovast.base.errors import DocumentError, InputError, RobovastError, one_of
from robovast.base.optional_deps import ROS, VIDEO
from robovast.base.plugins import plugins_of, split_file_reference
from robovast.base.serialization import fingerprint
from robovast.model.document.commands import (
    BAG_COMMANDS,
    GROUP,
    PROCESS,
    ImagesToWebm,
    bag_command,
    expanded,
)
from robovast.model.document.files import named_files
from robovast.model.document.problems import problems_of
from robovast.model.document.section import Plugin, PluginCall
from robovast.model.document.source import Source


@dataclass(frozen=True)
class PostprocessingCommand:
    """A plugin with its parameters, as called in a .vast file."""

    name: str
    parameters: dict[str, Any]
    folder: Path
    """Folder of the .vast file; paths are relative to it."""
    key: str
    """Digest of name, parameters, code and, where relevant, of the preceding commands."""
    given: Mapping[str, Any] = field(default_factory=dict)
    """Arguments besides the parameters, for plugins that accept them."""
    quiet: bool = False
    """The command is implied, not in the document; empty results are not reported."""

    @property
    def reads_bags(self) -> bool:
        """Whether the command can share one pass over a run's bags with others."""
        return self.name in BAG_COMMANDS

    @property
    def title(self) -> str:
        """The command's name in messages."""
        parts = split_file_reference(self.name)
        return parts[1] if parts else self.name


class _Section(BaseModel):
    postprocessing: list[Plugin] | None = None


class _Processing(BaseModel):
    """The relevant part of a .vast file; other tools' files may contain more."""

    results_processing: _Section = Field(default_factory=_Section)
    analysis: _Section = Field(default_factory=_Section)


def read_calls(path: Path) -> list[PluginCall]:
    """The postprocessing commands in a .vast file, under either spelling; the rest is not checked.

    Raises:
        InputError: the file cannot be read.
        DocumentError: the commands are invalid.
    """
    source = Source.read(path)
    sections = source.data if isinstance(source.data, dict) else {}
    named = ("results_processing", "analysis")
    data = {name: sections[name] for name in named if sections.get(name) is not None}
    try:
        model = _Processing.model_validate(data)
    except ValidationError as error:
        raise DocumentError(problems_of(error, source, _Processing)) from error
    sections_read = (model.results_processing, model.analysis)
    return [call for section in sections_read for call in section.postprocessing or []]


def resolve(
    calls: Iterable[PluginCall],
    folder: Path,
    given: Mapping[str, Any] | None = None,
    quiet: Sequence[PluginCall] = (),
) -> list[PostprocessingCommand]:
    """Commands in execution order.

    Commands that read bags are grouped at the position of the first of them and do not depend on
    one another. Any other command may read the output of preceding ones, so its key includes
    theirs.

    Args:
        calls: the document's calls; all must be callable.
        folder: the document's folder.
        given: arguments besides the parameters.
        quiet: the calls that are implied, not in the document.
    """
    commands: list[PostprocessingCommand] = []
    for call in _ordered(calls):
        reads_bags = call.name in BAG_COMMANDS
        before = [c.key for c in commands if not (reads_bags and c.reads_bags)]
        key = _key(call, folder, before)
        if key not in {command.key for command in commands}:
            parameters = dict(call.parameters)
            commands.append(
                PostprocessingCommand(
                    call.name, parameters, folder, key, given or {}, call in quiet
                )
            )
    return commands


def _ordered(calls: Iterable[PluginCall]) -> list[PluginCall]:
    listed = list(calls)
    of_bags = [call for call in listed if call.name in BAG_COMMANDS]
    first = listed.index(of_bags[0]) if of_bags else 0
    rest = [call for call in listed[first:] if call.name not in BAG_COMMANDS]
    return [*listed[:first], *of_bags, *rest]


def why_not(call: PluginCall) -> str | None:
    """Why a command can never be called; None if nothing is known against it."""
    try:
        if call.name in BAG_COMMANDS:
            job = bag_command(call.name, call.parameters)
            ROS.require(call.name)
            if isinstance(job, ImagesToWebm):
                VIDEO.require(call.name)
        elif call.name == PROCESS:
            expanded([call])
    except RobovastError as error:
        return str(error)
    return None


def skipped(calls: Iterable[PluginCall], names: Sequence[str]) -> list[PluginCall]:
    """The calls without skipped ones, which are given by name or by the name in a file reference;
    commands within `rosbags_process` can be skipped, too.

    Raises:
        InputError: the document has no command of that name.
    """
    kept = list(calls)
    for name in names:
        if not any(_is_called(call, name) for call in kept):
            kept = unfolded(kept)
        rest = [call for call in kept if not _is_called(call, name)]
        if len(rest) == len(kept):
            hint = one_of((f"`{call.name}`" for call in kept), "remove `--skip`")
            raise InputError(f"--skip {name}: there is no such command", hint=hint)
        kept = rest
    return kept


def unfolded(calls: Iterable[PluginCall]) -> list[PluginCall]:
    """The calls, with each valid `rosbags_process` replaced by its commands; errors are reported
    when it is called."""
    return [
        part for call in calls for part in (expanded([call]) if why_not(call) is None else [call])
    ]


def _is_called(call: PluginCall, name: str) -> bool:
    return name in (call.name, _short(call.name))


def _short(name: str) -> str:
    parts = split_file_reference(name)
    return parts[1] if parts else name


def _key(call: PluginCall, folder: Path, before: list[str]) -> str:
    named = named_files(folder, call.parameters)
    files = {str(path): file_digest(folder / path) for path in named}
    parts = [call.name, call.parameters, _code_version(call.name, folder), files, before]
    return fingerprint(parts)[:32]


def _code_version(name: str, folder: Path) -> str:
    """A digest of a plugin's source, or its name if the source cannot be found."""
    parts = split_file_reference(name)
    try:
        if parts is not None:
            return file_digest(Path(os.path.realpath(folder / parts[0])))
        return _package_version(plugins_of(GROUP)[name])
    except (KeyError, OSError, ImportError, ValueError):
        return ""


def _package_version(entry: EntryPoint) -> str:
    """A digest of the distribution's version and the modules in the plugin's package."""
    version = entry.dist.version if entry.dist else ""
    spec = find_spec(entry.module)
    if spec is None or not spec.origin:
        return version
    origin = Path(spec.origin)
    in_package = "." in entry.module or origin.name == "__init__.py"
    names = scan(origin.parent) if in_package else [origin.name]
    return fingerprint([version, digests(origin.parent, (n for n in names if n.endswith(".py")))])
