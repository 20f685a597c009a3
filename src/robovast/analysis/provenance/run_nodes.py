"""Nodes of a run: the run, its output, and files derived from it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any

from robovast.analysis.provenance.contributions import Node
from robovast.analysis.provenance.postprocessing import Derivation
from robovast.analysis.provenance.runs import BAG_METADATA, bags_of
from robovast.analysis.provenance.vocabulary import SOFTWARE, path_iri
from robovast.campaign.verdict import Verdict

EXECUTION = "execution/"
_POSTPROCESSING = "postprocessing/"

_TYPES = {
    ".log": "robovast:LogFile",
    ".xml": "robovast:TestResult",
    ".mcap": "robovast:MCAPFile",
    ".db3": "robovast:SQLiteFile",
}

_SYSINFO = (
    "cpu_name", "instance_type", "available_cpus", "available_mem", "platform", "system",
    "release", "version", "machine", "processor",
)  # fmt: skip


def run_nodes(
    result: dict[str, Any],
    used: Iterable[str],
    agents: Iterable[str],
    derivations: list[Derivation],
    *,
    alone: bool,
) -> Iterator[Node]:
    """Nodes of a run.

    Args:
        result: the run's entry in `test_results`.
        used: IRIs that the run used.
        agents: IRIs of the run's agents.
        derivations: derived files in the run's folder.
        alone: no other run shares the run's job, so the job's files belong to the run.
    """
    iri = path_iri(result["dir"])
    run = _run(result, iri, used, agents)
    yield run if alone or not result.get("job") else {**run, "job": path_iri(f"{result['job']}/")}
    bags = {f"{result['dir']}/{name}": bag for name, bag in bags_of(result).items()}
    made = {derivation.output for derivation in derivations}
    parts = {f"{folder}/{name}" for folder, bag in bags.items() for name in bag["files"]}
    files = [name for name in result.get("output_files") or () if name not in made | parts]
    yield from (_file(name, iri) for name in files)
    for folder, bag in bags.items():
        yield from _bag(folder, bag, iri)
    if alone:
        yield from job_files(result, iri)
    if derivations:
        activity = f"{iri}/{_POSTPROCESSING}"
        yield from derivation_nodes(activity, derivations, bags, [*files, *made])
        yield {"@id": activity, "wasInformedBy": iri, "isPartOf": _POSTPROCESSING}


def _run(result: dict[str, Any], iri: str, used: Iterable[str], agents: Iterable[str]) -> Node:
    node = {
        "@id": iri,
        "@type": ["Activity", "robovast:TestExecution"],
        "used": list(dict.fromkeys(used)),
        "startedAtTime": result.get("start_time"),
        "endedAtTime": result.get("end_time"),
        "wasAssociatedWith": list(agents),
        "wasInfluencedBy": EXECUTION,
        "verdict": result.get("verdict"),
        "reason": result.get("reason"),
        "seed": result.get("seed"),
    }
    if result.get("reused_from"):  # what happened is the other campaign's run, in its graph
        node["wasInformedBy"] = f"../{path_iri(result['reused_from'])}"
        node["reused_from"] = result["reused_from"]
    if result.get("verdict") != Verdict.INTERRUPTED:  # such a run counts as not executed
        node["success"] = str(result.get("success")).lower() == "true"
    if result.get("sysinfo_file"):
        node["sysinfo"] = path_iri(result["sysinfo_file"])
    return compact(node)


def compact(node: Node) -> Node:
    """A node without unknown properties."""
    return {key: value for key, value in node.items() if value not in (None, [], "")}


def _file(name: str, activity: str) -> Node:
    return {"@id": path_iri(name), "@type": _kinds(name), "wasGeneratedBy": activity}


def _kinds(name: str) -> list[str]:
    kind = _TYPES.get(name[name.rfind(".") :])
    return ["Entity", kind] if kind else ["Entity"]


def job_files(result: dict[str, Any], activity: str) -> Iterator[Node]:
    """Nodes of the files of a run's job."""
    return (_file(name, activity) for name in result.get("job_files") or ())


def sysinfo_node(result: dict[str, Any]) -> Node | None:
    """The machine that executed a run."""
    path, content = result.get("sysinfo_file"), result.get("sysinfo")
    if not path or not isinstance(content, dict):
        return None
    platform = content.get("platform")
    flat = {**content, **(platform if isinstance(platform, dict) else {})}
    values = {key: flat[key] for key in _SYSINFO if isinstance(flat.get(key), str | int | float)}
    return compact(
        {**values, "@id": path_iri(path), "@type": ["Entity", "robovast:SystemInformation"]}
    )


def _bag(folder: str, bag: dict[str, Any], activity: str) -> Iterator[Node]:
    parts = [f"{folder}/{name}" for name in bag["files"]]
    yield compact(
        {
            "@id": path_iri(f"{folder}/"),
            "@type": ["Entity", "Collection", "robovast:ROSBag"],
            "wasGeneratedBy": activity,
            "hadMember": [path_iri(part) for part in parts],
            "hasVersion": bag.get("ros_distro"),
            "message_types": bag.get("message_types"),
        }
    )
    for part in parts:
        is_metadata = part.endswith(f"/{BAG_METADATA}")
        kinds = ["Entity", "robovast:BagFile#Metadata"] if is_metadata else _kinds(part)
        yield {"@id": path_iri(part), "@type": kinds}


def derivation_nodes(
    activity: str,
    derivations: Iterable[Derivation],
    bags: Iterable[str],
    known: Iterable[str],
) -> Iterator[Node]:
    """Nodes of a postprocessing activity and everything it made.

    Args:
        activity: the activity's IRI.
        derivations: files that the activity made.
        bags: folders of bags; an activity that read part of a bag used the bag.
        known: paths that already have a node.
    """
    described = set(known)
    used: dict[str, None] = {}
    for derivation in derivations:
        sources = [_source_iri(source, bags) for source in derivation.sources]
        used.update(dict.fromkeys(sources))
        yield compact(
            {
                "@id": path_iri(derivation.output),
                "@type": ["Entity", "robovast:Traces"],
                "wasGeneratedBy": activity,
                "wasDerivedFrom": sources,
                "plugin": derivation.plugin,
                "params": json.dumps(derivation.params, default=str) if derivation.params else None,
            }
        )
        for source in set(derivation.sources) - described:
            yield {"@id": _source_iri(source, bags), "@type": ["Entity"]}
    yield compact(
        {
            "@id": activity,
            "@type": ["Activity", "robovast:Postprocessing"],
            "used": list(used),
            "wasAssociatedWith": SOFTWARE,
        }
    )


def _source_iri(source: str, bags: Iterable[str]) -> str:
    bag = next((b for b in bags if source == b or source.startswith(f"{b}/")), None)
    return path_iri(source if bag is None else f"{bag}/")
