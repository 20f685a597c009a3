"""Collects the content of metadata.yaml from a campaign's folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from robovast.analysis.provenance.hooks import VariationHooks, process, processors_of
from robovast.analysis.provenance.problems import Findings
from robovast.analysis.provenance.reading import list_files, read_mapping, subfolders
from robovast.analysis.provenance.runs import describe_run
from robovast.analysis.provenance.searches import describe_search
from robovast.analysis.provenance.times import as_utc, later
from robovast.base.safe_paths import MOST_OF_ALL
from robovast.campaign.decisions import decide, recorded_test
from robovast.campaign.layout import (
    POSTPROCESSING,
    SCENARIO_CONFIG,
    VARIANT_RECORD,
    Layout,
    is_variant,
)
from robovast.campaign.verdict import Verdict
from robovast.model.naming import CONFIG, TRANSIENT, is_run_number
from robovast.model.variations.factors import FACTORS


def collect_metadata(
    root: Path, configurations: dict[str, Any], findings: Findings
) -> dict[str, Any]:
    """The content of metadata.yaml, including additions of hooks and processors.

    Args:
        root: the campaign's folder.
        configurations: content of its configurations.yaml.
        findings: collects missing data and errors of plugins.
    """
    layout = Layout(root)
    document_name, document = _read_document(layout, configurations.get("vast"), findings)
    execution = read_mapping(layout.execution_record, findings, root.name)
    hooks = VariationHooks(root, findings)
    metadata = {
        "vast_file": document_name,
        "run_files": [f"{CONFIG}/{name}" for name in configurations.get("_run_files") or ()],
        "scenario_file": _scenario_file(document, configurations),
        "metadata": document.get("metadata") or configurations.get("metadata") or {},
        "execution": execution,
        "postprocessing": read_mapping(
            layout.transient / POSTPROCESSING, findings, root.name, needed=False
        ),
        "configurations": [
            _describe_configuration(layout, item, execution, hooks, findings)
            for item in _configurations(layout, configurations)
        ],
    }
    if batches := describe_search(layout, findings):
        metadata["search"] = batches
    return process(metadata, processors_of(document, findings), root, findings)


def read_configurations(root: Path, findings: Findings) -> dict[str, Any]:
    """Content of a campaign's configurations.yaml."""
    path = Layout(root).configurations
    return read_mapping(path, findings, root.name, most=MOST_OF_ALL)


def applied_variations(entry: dict[str, Any]) -> list[str]:
    """Names of a configuration's variation types in order, without duplicates."""
    found = entry.get("variations") or entry.get("_variations") or ()
    return list(dict.fromkeys(str(v["name"]) for v in found if isinstance(v, dict) and "name" in v))


def _read_document(
    layout: Layout, named: Any, findings: Findings
) -> tuple[str | None, dict[str, Any]]:
    """Name and content of the campaign's .vast file."""
    files = sorted(layout.documents, key=lambda file: (file.name != named, file.name))
    if not files:
        findings.missing("no .vast file in _config", layout.root.name)
        return None, {}
    return f"{CONFIG}/{files[0].name}", read_mapping(files[0], findings, layout.root.name)


def _scenario_file(document: dict[str, Any], configurations: dict[str, Any]) -> str | None:
    execution = document.get("execution")
    named = execution.get("scenario_file") if isinstance(execution, dict) else None
    found = configurations.get("scenario_file") or named
    return str(found) if found else None


def _configurations(layout: Layout, configurations: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The listed configurations, then those that only have a folder."""
    listed = [item for item in configurations.get("configs") or () if _is_configuration(item)]
    yield from listed
    names = {item["name"] for item in listed}
    for folder in subfolders(layout.root):
        if folder not in names and _is_configuration_folder(layout.root / folder):
            yield {"name": folder, "config": _read_parameters(layout.variant(folder))}


def _is_configuration(item: Any) -> bool:
    name = item.get("name") if isinstance(item, dict) else None
    return isinstance(name, str) and name != "" and "/" not in name and is_variant(name)


def _is_configuration_folder(folder: Path) -> bool:
    if not is_variant(folder.name):
        return False
    inside = subfolders(folder)
    return CONFIG in inside or any(map(is_run_number, inside))


def _read_parameters(folder: Path) -> dict[str, Any]:
    """Scenario parameters of a variant."""
    content = read_mapping(folder / SCENARIO_CONFIG, Findings(), "")
    values: Any = next(iter(content.values()), {})
    return values if isinstance(values, dict) else {}


def _describe_configuration(
    layout: Layout,
    item: dict[str, Any],
    execution: dict[str, Any],
    hooks: VariationHooks,
    findings: Findings,
) -> dict[str, Any]:
    name = item["name"]
    folder = layout.variant(name)
    identity = read_mapping(folder / VARIANT_RECORD, findings, name)
    given = item["config"] if isinstance(item.get("config"), dict) else {}
    config = {str(key): value for key, value in given.items()}
    variations = [dict(v) for v in item.get("_variations") or () if isinstance(v, dict)]
    entry = {
        "name": name,
        "config": config,
        "config_files": [f"{name}/{CONFIG}/{file}" for file in _names(item.get("_config_files"))],
        "created_at": item.get("created_at") or _created(variations, execution),
        "derived_from": item.get("derived_from") or item.get("_config_name"),
        "config_identifier": identity.get("config_identifier"),
        "sub_identifier": identity.get("sub_identifier") or {},
        "variations": variations,
        "parameters": {key: value for key, value in config.items() if not key.startswith("_")},
        **({"factors": item[FACTORS]} if isinstance(item.get(FACTORS), dict) else {}),
        "transient_files": list(list_files(str(folder / TRANSIENT), f"{name}/{TRANSIENT}/")),
    }
    added = hooks.metadata(applied_variations(entry), {**item, **entry})
    runs = sorted(filter(is_run_number, subfolders(folder)), key=int)
    if not runs:
        findings.missing("configurations without a run", name)
    results = [describe_run(layout.root, name, number, findings) for number in runs]
    return {**entry, **added, **_decision(execution, name, results), "test_results": results}


def _decision(
    execution: Mapping[str, Any], name: str, results: Iterable[Mapping[str, Any]]
) -> dict[str, dict[str, Any]]:
    """What the runs of a configuration decide about it, where they were executed as needed."""
    test = recorded_test(execution)
    if test is None:
        return {}
    numbered = ((result["dir"].rpartition("/")[2], result["verdict"]) for result in results)
    found = decide(test.of(name), {int(number): Verdict(verdict) for number, verdict in numbered})
    return {"decision": {**asdict(found), "state": str(found.state)}}


def _names(files: Any) -> Iterator[str]:
    """Relative names of files, which are listed as names or as pairs with absolute paths."""
    for file in files or ():
        yield str(file[0] if isinstance(file, list | tuple) and file else file)


def _created(variations: Iterable[dict[str, Any]], execution: dict[str, Any]) -> str | None:
    """When a configuration was created: after its last variation, or when runs began."""
    ends = [end for _, end in map(variation_times, variations) if end]
    if ends:
        return max(ends)
    return as_utc(execution.get("execution_time"))


def variation_times(record: dict[str, Any]) -> tuple[str | None, str | None]:
    """Start and end of the application of a variation."""
    start = as_utc(record.get("started_at"))
    return start, later(start, record.get("duration"))
