"""The files that a campaign is made from, relative to the .vast file's folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from robovast.base.plugins import split_file_reference
from robovast.model.document import Document
from robovast.model.document.files import host_path, named_files, run_files
from robovast.model.document.model import PluginCall
from robovast.model.expansion import Composition


def container_files(document: Document) -> list[Path]:
    """What every run needs below `/config`: the scenario, run files, pre and post command."""
    execution = document.vast.execution
    found = set(run_files(document.folder, execution.run_files))
    found.add(Path(document.vast.scenario_file or ""))
    for command in (execution.pre_command, execution.post_command):
        path = host_path(document.folder, command) if command else None
        if path is not None:
            found.add(path.relative_to(document.folder))
    return sorted(found)


def campaign_files(document: Document, composition: Composition) -> list[Path]:
    """Everything that makes the campaign's `_config` folder complete by itself."""
    found = {Path(document.path.name), *container_files(document), *composition.input_files}
    found.update(path for path in _referenced(document) if (document.folder / path).is_file())
    return sorted(path for path in found if not path.is_absolute() and ".." not in path.parts)


def _referenced(document: Document) -> Iterator[Path]:
    for notebooks in document.vast.visualization.values():
        for notebook in notebooks.model_dump(exclude_none=True).values():
            yield Path(notebook)
    for call in _plugin_calls(document):
        parts = split_file_reference(call.name)
        if parts is not None:
            yield Path(parts[0])
    for call in document.vast.postprocessing:
        yield from named_files(document.folder, call.parameters)


def _plugin_calls(document: Document) -> Iterator[PluginCall]:
    vast = document.vast
    for entry in vast.configuration or []:
        yield from entry.variations or []
    yield from vast.postprocessing
    yield from vast.results_processing.publication
    yield from vast.results_processing.metadata_processing
