"""Writes metadata.yaml and metadata.prov.json of a campaign."""

from __future__ import annotations

import gc
import json
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from robovast.analysis.provenance.graph import Graph
from robovast.analysis.provenance.metadata import collect_metadata, read_configurations
from robovast.analysis.provenance.problems import Findings
from robovast.analysis.provenance.reading import read_mapping
from robovast.analysis.provenance.times import now
from robovast.analysis.provenance.vocabulary import context
from robovast.base.atomic import appearing_file, write_atomically
from robovast.base.errors import InputError
from robovast.base.file_errors import writing
from robovast.base.safe_paths import MOST_OF_ALL
from robovast.base.serialization import dump_yaml
from robovast.base.version import __version__
from robovast.model.naming import GRAPH, METADATA

_log = logging.getLogger(__name__)


class PluginFaultsError(InputError):
    """Plugins failed; their additions are missing, everything else is written."""

    def __init__(self, root: Path, file: str, faults: list[str]) -> None:
        self.faults = faults
        lines = "\n".join(f"    {fault}" for fault in faults)
        super().__init__(
            f"{root / file} was written without the additions of these plugins:\n{lines}\n"
            "    Fix them, then repeat `vast results metadata`."
        )


def describe(campaign_dir: Path, *, own_plugins: bool = True) -> None:
    """Write metadata.yaml and metadata.prov.json; faster than writing them one by one.

    Args:
        campaign_dir: the campaign's folder.
        own_plugins: whether plugins in the campaign's own files are executed.

    Raises:
        PluginFaultsError: a plugin failed; both files are written nevertheless.
        StorageError: a file cannot be written.
    """
    root, findings = _absolute(campaign_dir), Findings(own_plugins=own_plugins)
    with _no_garbage_collection():
        configurations = read_configurations(root, findings)
        metadata = _write_metadata(root, configurations, findings)
        _write_graph(root, metadata, configurations, findings)
    _report(root, f"{METADATA} and {GRAPH}", findings)


def write_metadata(campaign_dir: Path) -> Path:
    """Write metadata.yaml and return its path. Missing data is logged as warnings.

    Raises:
        PluginFaultsError: a hook or a processor failed; the file is written nevertheless.
        StorageError: the file cannot be written.
    """
    root, findings = _absolute(campaign_dir), Findings()
    _write_metadata(root, read_configurations(root, findings), findings)
    _report(root, METADATA, findings)
    return campaign_dir / METADATA


def write_graph(campaign_dir: Path) -> Path:
    """Write metadata.prov.json from metadata.yaml and return its path.

    Raises:
        InputError: there is no metadata.yaml.
        PluginFaultsError: a hook failed; the file is written nevertheless.
        StorageError: the file cannot be written.
    """
    root, findings = _absolute(campaign_dir), Findings()
    metadata = read_mapping(root / METADATA, findings, root.name, most=MOST_OF_ALL)
    if not isinstance(metadata.get("configurations"), list):
        raise InputError(
            f"{root / METADATA} is missing or damaged",
            hint="run `vast results metadata` to write it",
        )
    _write_graph(root, metadata, read_configurations(root, Findings()), findings)
    _report(root, GRAPH, findings)
    return campaign_dir / GRAPH


def _absolute(path: Path) -> Path:
    """The path ending with the campaign's name, even if it was given as `.`."""
    return Path(os.path.abspath(path))


def _write_metadata(
    root: Path, configurations: dict[str, Any], findings: Findings
) -> dict[str, Any]:
    started = now()
    metadata = collect_metadata(root, configurations, findings)
    times = {"started_at": started, "ended_at": now(), "robovast_version": __version__}
    metadata["generated"] = times
    with writing(root):
        write_atomically(root / METADATA, dump_yaml(metadata))
    return metadata


def _write_graph(
    root: Path, metadata: dict[str, Any], configurations: dict[str, Any], findings: Findings
) -> None:
    started = now()
    graph = Graph(root, metadata, configurations, findings)
    with (
        writing(root),
        appearing_file(root / GRAPH) as part,
        part.open("w", encoding="utf-8") as file,
    ):
        _write_nodes(file, graph, started)


def _write_nodes(file: IO[str], graph: Graph, started: str) -> None:
    """Write one node per line as they are made, so that memory does not grow with the graph."""
    encode = json.JSONEncoder(ensure_ascii=False, default=str).encode
    file.write(f'{{"@context": {encode(context(graph.iri))},\n"@graph": [\n')
    for node in graph.nodes():
        file.write(f"{encode(node)},\n")
    last = (encode(node) for node in graph.graph_file(GRAPH, started, now()))
    file.write(",\n".join(last) + "\n]}\n")


def _report(root: Path, file: str, findings: Findings) -> None:
    for notice in findings.notices:
        _log.warning("%s: %s", root.name, notice)
    if findings.faults:
        raise PluginFaultsError(root, file, findings.faults)


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Suspend garbage collection: the metadata of many runs stays in use, and repeated collection
    would take half of the time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
