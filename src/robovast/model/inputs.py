"""The input files of a campaign, relative to the .vast file's folder."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError, RobovastError
from robovast.base.file_errors import read_content
from robovast.base.plugins import (
    PluginRefusedError,
    load_plugin,
    plugin_errors,
    raised,
    split_file_reference,
)
from robovast.model.document import Document
from robovast.model.document.commands import BUILT_IN, GROUP
from robovast.model.document.files import host_path, named_files, run_files
from robovast.model.document.section import PluginCall
from robovast.model.expansion import Composition

_WANTED = "get_files_to_copy"
"""Optional method of postprocessing commands that lists input files."""


def container_files(document: Document) -> list[Path]:
    """Files that every run needs below `/config`: scenario, run files, pre and post command."""
    execution = document.vast.execution
    found = set(run_files(document.folder, execution.run_files))
    found.add(Path(document.vast.scenario_file or ""))
    for command in (execution.pre_command, execution.post_command):
        path = host_path(document.folder, command) if command else None
        if path is not None:
            found.add(path.relative_to(document.folder))
    return sorted(found)


def campaign_files(document: Document, composition: Composition) -> list[Path]:
    """All files that make the campaign's `_config` folder self-contained."""
    found = {Path(document.path.name), *container_files(document), *composition.input_files}
    found.update(path for path in _referenced(document) if os.path.isfile(document.folder / path))
    return sorted(path for path in found if not path.is_absolute() and ".." not in path.parts)


def _referenced(document: Document) -> Iterator[Path]:
    for notebooks in document.vast.visualization.values():
        for notebook in notebooks.model_dump(exclude_none=True).values():
            yield Path(notebook)
    for call in _plugin_calls(document):
        parts = split_file_reference(call.name)
        if parts is not None:
            yield Path(parts[0])
    search = document.vast.search
    for call in [*document.vast.postprocessing, *(search.postprocessing if search else ())]:
        yield from named_files(document.folder, call.parameters)
        yield from _wanted_files(document.folder, call)


def _wanted_files(folder: Path, call: PluginCall) -> Iterator[Path]:
    """Input files that a postprocessing class requests.

    Raises:
        InputError: the method fails or names a file outside the document's folder.
    """
    plugin = _class_with_files(folder, call)
    if plugin is None:
        return
    what = f"{call.name}: `{_WANTED}` raised"
    with plugin_errors(lambda error: InputError(f"{what} {raised(error)}")):
        made = plugin(**call.parameters) if inspect.signature(plugin).parameters else plugin()
        wanted = [folder / path for path in made.get_files_to_copy(str(folder), call.parameters)]
    for path in wanted:
        if not path.is_relative_to(folder):
            raise InputError(f"{call.name}: `{_WANTED}` names {path}, which is not in {folder}.")
        below = sorted(path.rglob("*")) if os.path.isdir(path) else [path]
        yield from (file.relative_to(folder) for file in below if os.path.isfile(file))


def _class_with_files(folder: Path, call: PluginCall) -> Any:
    """The command's class if it lists input files, else None.

    A file that does not mention the method is not executed.
    """
    parts = split_file_reference(call.name)
    if call.name in BUILT_IN or (parts and not _mentions(folder / parts[0], _WANTED)):
        return None
    try:
        plugin = load_plugin(call.name, GROUP, folder)
    except PluginRefusedError:
        raise
    except RobovastError:
        return None  # it is needed only for results; a check warns of it
    return plugin if inspect.isclass(plugin) and hasattr(plugin, _WANTED) else None


def _mentions(path: Path, name: str) -> bool:
    return os.path.isfile(path) and name.encode() in read_content(path)


def _plugin_calls(document: Document) -> Iterator[PluginCall]:
    vast = document.vast
    for entry in vast.configuration or []:
        yield from entry.variations or []
    yield from vast.postprocessing
    if vast.search is not None:
        yield from vast.search.variations or []
        yield from vast.search.postprocessing
        yield PluginCall(name=vast.search.strategy, parameters=vast.search.strategy_parameters)
        yield PluginCall(name=vast.search.extract.plugin, parameters=vast.search.extract.params)
    yield from vast.results_processing.publication
    yield from vast.results_processing.metadata_processing
