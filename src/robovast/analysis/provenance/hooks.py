"""Calls plugins: hooks of variations and metadata processors."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from robovast.analysis.provenance.problems import Findings
from robovast.analysis.provenance.processor import MetadataProcessor
from robovast.base.plugins import load_plugin, plugins_of, split_file_reference
from robovast.base.serialization import to_plain
from robovast.model.document.section import Plugin, PluginCall
from robovast.model.naming import CONFIG
from robovast.model.variations.base_variation import ProvContribution, Variation
from robovast.model.variations.loader import GROUP, load_variation

PROCESSORS = "robovast.metadata_processing"
_FIXED = frozenset({"name", "test_results"})
"""Keys that identify a configuration; hooks must not set them."""


class VariationHooks:
    """The hooks of a campaign's variation types.

    Args:
        root: the campaign's folder.
        findings: collects missing data and errors of plugins.
    """

    def __init__(self, root: Path, findings: Findings) -> None:
        self._root = root
        self._findings = findings
        self._load = cache(self._load_once)

    def metadata(self, names: Iterable[str], entry: dict[str, Any]) -> dict[str, Any]:
        """Additions of `collect_config_metadata` of each variation type to an entry."""
        added: dict[str, Any] = {}
        folder = self._root / entry["name"]
        for name in names:
            hook = self._hook(name, "collect_config_metadata")
            if hook is None:
                continue
            who, function = hook
            result = self._findings.call(
                who, entry["name"], _plain_mapping, function, {**entry, **added}, folder, self._root
            )
            added.update(result or {})
        return added

    def contributions(
        self, names: Iterable[str], entry: dict[str, Any], *context: Any
    ) -> list[tuple[str, ProvContribution]]:
        """Additions of `collect_prov_metadata` of each variation type, with the hook's name.

        Args:
            names: the variation types of the configuration.
            entry: the configuration's entry.
            context: namespaces of the campaign and the configuration, IRIs of the generation and
                of the .vast file.
        """
        found = []
        for name in names:
            hook = self._hook(name, "collect_prov_metadata")
            if hook is None:
                continue
            who, function = hook
            result = self._findings.call(
                who, entry["name"], _contribution, function, entry, *context
            )
            if result is not None:
                found.append((who, result))
        return found

    def any_contributes(self, names: Iterable[str]) -> bool:
        """True if any variation type contributes to the graph."""
        return any(self._hook(name, "collect_prov_metadata") for name in names)

    def _hook(self, name: str, method: str) -> tuple[str, Any] | None:
        """A hook that a variation type overrides, and its name in messages."""
        found = self._load(name)
        if found is None:
            return None
        function = getattr(found, method)
        inherited = getattr(Variation, method)
        if getattr(function, "__func__", function) is inherited.__func__:
            return None
        return f"{name}.{method}", function

    def _load_once(self, name: str) -> type[Variation] | None:
        if self._findings.leaves_out(name):
            return None
        if split_file_reference(name) is None and name not in plugins_of(GROUP):
            self._findings.missing("variation types that are not installed, nothing added", name)
            return None
        return self._findings.call(name, "", load_variation, name, self._root / CONFIG)


def _plain_mapping(function: Any, *args: Any) -> dict[str, Any]:
    result = function(*args)
    if result is None:
        return {}
    if not isinstance(result, dict):
        raise TypeError(f"it returned a {type(result).__name__}, not a dict")
    if taken := _FIXED & result.keys():
        raise ValueError(f"it returned `{min(taken)}`, which no hook may set")
    plain: dict[str, Any] = to_plain(result)
    return plain


def _contribution(function: Any, *args: Any) -> ProvContribution | None:
    result = function(*args)
    if result is not None and not isinstance(result, ProvContribution):
        raise TypeError(f"it returned a {type(result).__name__}, not a ProvContribution or None")
    return result


def processors_of(document: dict[str, Any], findings: Findings) -> list[PluginCall]:
    """The processors in a .vast file, in order."""
    section = document.get("results_processing") or {}
    written = section.get("metadata_processing") if isinstance(section, dict) else None
    try:
        return _CALLS.validate_python(written or [])
    except ValidationError as error:
        cause = error.errors(include_url=False)[0]["msg"]
        findings.fault(f"results_processing.metadata_processing: {cause}")
        return []


_CALLS = TypeAdapter(list[Plugin])


def process(
    metadata: dict[str, Any], calls: Iterable[PluginCall], root: Path, findings: Findings
) -> dict[str, Any]:
    """Apply all processors to the metadata; processors that fail are skipped."""
    for call in calls:
        if findings.leaves_out(call.name):
            continue
        result = findings.call(call.name, "", _process_once, metadata, call, root)
        metadata = metadata if result is None else result
    return metadata


def _process_once(metadata: dict[str, Any], call: PluginCall, root: Path) -> dict[str, Any]:
    found = load_plugin(call.name, PROCESSORS, root / CONFIG)
    if not (isinstance(found, type) and issubclass(found, MetadataProcessor)):
        raise TypeError(
            "it must be a class that inherits from robovast.common.metadata.MetadataProcessor"
        )
    result = found(**call.parameters).process_metadata(to_plain(metadata), root)
    if not isinstance(result, dict):
        raise TypeError(
            f"process_metadata returned a {type(result).__name__}, not the metadata (a dict)"
        )
    plain: dict[str, Any] = to_plain(result)
    entries = plain.get("configurations")
    if not (
        isinstance(entries, list) and all(isinstance(e, dict) and "name" in e for e in entries)
    ):
        raise ValueError("process_metadata returned metadata without a list of `configurations`")
    return plain
