"""The recorded origin of tables and other generated files, by run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Derivation:
    """A file made by postprocessing; paths are relative to the campaign."""

    output: str
    sources: tuple[str, ...]
    plugin: str
    params: Any = field(default=None, compare=False)


def derivations_by_run(campaign: str, metadata: dict[str, Any]) -> dict[str, list[Derivation]]:
    """Derivations by the folder of the run that contains them; "" for those outside of runs.

    Args:
        campaign: name of the campaign's folder.
        metadata: content of metadata.yaml.
    """
    runs = {
        result["dir"]: result
        for entry in metadata["configurations"]
        for result in entry.get("test_results") or ()
    }
    found: dict[str, dict[str, Derivation]] = {}
    for folder, record in [("", metadata), *runs.items()]:
        for derivation in _derivations(campaign, folder, record.get("postprocessing")):
            run = "/".join(derivation.output.split("/", 2)[:2])
            place = run if run in runs else ""
            found.setdefault(place, {})[derivation.output] = derivation
    return {folder: list(items.values()) for folder, items in found.items()}


def _derivations(campaign: str, folder: str, record: Any) -> Iterator[Derivation]:
    entries = record.get("entries") if isinstance(record, dict) else record
    for entry in entries if isinstance(entries, list) else ():
        if isinstance(entry, dict) and entry.get("output"):
            output = _in_campaign(str(entry["output"]), campaign, folder)
            sources = _sources(entry.get("sources"), campaign, folder)
            yield Derivation(
                output,
                tuple(dict.fromkeys(s for s in sources if s != output)),
                str(entry.get("plugin") or ""),
                entry.get("params"),
            )


def _sources(sources: Any, campaign: str, folder: str) -> Iterable[str]:
    listed = [sources] if isinstance(sources, str) else sources or ()
    return [_in_campaign(str(source), campaign, folder) for source in listed]


def _in_campaign(path: str, campaign: str, folder: str) -> str:
    """A path relative to the campaign.

    Plugins write paths relative to the results folder, the campaign or the run.
    """
    parts = [part for part in path.split("/") if part not in {"", "."}]
    if campaign in parts:
        parts = parts[parts.index(campaign) + 1 :]
    elif folder and not path.startswith("_") and parts[:1] != folder.split("/")[:1]:
        parts = [*folder.split("/"), *parts]
    return "/".join(parts)
