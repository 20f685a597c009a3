"""The PROV-O graph of a campaign: JSON-LD nodes made from its metadata."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from robovast.analysis.provenance import agents
from robovast.analysis.provenance.contributions import Node, plain_iri, plain_node, with_properties
from robovast.analysis.provenance.hooks import VariationHooks
from robovast.analysis.provenance.metadata import applied_variations, variation_times
from robovast.analysis.provenance.postprocessing import Derivation, derivations_by_run
from robovast.analysis.provenance.problems import Findings
from robovast.analysis.provenance.run_nodes import (
    EXECUTION,
    compact,
    derivation_nodes,
    job_files,
    run_nodes,
    sysinfo_node,
)
from robovast.analysis.provenance.searches import search_nodes
from robovast.analysis.provenance.times import as_utc, from_epoch
from robovast.analysis.provenance.vocabulary import (
    DEFAULT_DATASET,
    SCENARIOS,
    SOFTWARE,
    is_iri,
    path_iri,
)
from robovast.campaign.layout import CONFIGURATIONS, EXECUTION_RECORD, SCENARIO_CONFIG
from robovast.model.naming import CONFIG
from robovast.model.variations.factors import factor_units, factor_values

GENERATION = "config_generation"
POSTPROCESSING = "postprocessing/"
_RECORDS = (EXECUTION_RECORD, CONFIGURATIONS)
"""What metadata.yaml is made of, beside the folders of the runs."""


def campaign_iri(root: Path, metadata: dict[str, Any]) -> str:
    """IRI of a campaign: its dataset's IRI, its folder's name and a slash."""
    return dataset_iri(metadata) + path_iri(root.name) + "/"


def dataset_iri(metadata: dict[str, Any]) -> str:
    """IRI of the dataset in the .vast file, or the default one."""
    named = _section(metadata, "metadata").get("dataset_iri")
    if not is_iri(named):
        return DEFAULT_DATASET
    return str(named) if str(named).endswith(("/", "#")) else f"{named}/"


def _section(metadata: dict[str, Any], name: str) -> dict[str, Any]:
    section = metadata.get(name)
    return section if isinstance(section, dict) else {}


class Graph:
    """The nodes of one campaign.

    Args:
        root: the campaign's folder.
        metadata: content of its metadata.yaml.
        configurations: content of its configurations.yaml, including the variations' private keys,
            which hooks may use.
        findings: collects errors of hooks.
    """

    def __init__(
        self,
        root: Path,
        metadata: dict[str, Any],
        configurations: dict[str, Any],
        findings: Findings,
    ) -> None:
        self.iri = campaign_iri(root, metadata)
        self._root = root
        self._metadata = metadata
        self._findings = findings
        self._hooks = VariationHooks(root, findings)
        listed = configurations.get("configs") or ()
        self._extras = {i["name"]: i for i in listed if isinstance(i, dict) and "name" in i}
        self._dataset = dataset_iri(metadata)
        self._description = _section(metadata, "metadata")
        self._systems = agents.systems(self._description.get("agents"), self._dataset)
        self._agents = [node["@id"] for node in self._systems] or [SOFTWARE]
        self._people = agents.people(self._description.get("creator"), self._dataset)
        self._vast = _optional_iri(metadata.get("vast_file"))
        scenario = metadata.get("scenario_file")
        self._scenario = path_iri(f"{CONFIG}/{scenario}") if scenario else None
        self._derivations = derivations_by_run(root.name, metadata)
        self._runs_of_job = Counter(result.get("job") for result in self._results())
        self._written: set[str] = set()

    def nodes(self) -> Iterator[Node]:
        """All nodes except those of the graph file itself."""
        yield agents.software()
        yield from self._systems
        yield from self._people
        yield from self._campaign()
        yield from self._inputs()
        yield self._generation()
        for entry in self._metadata["configurations"]:
            yield from self._configuration(entry)
        yield from search_nodes(self._metadata.get("search") or (), self._vast)
        yield from self._jobs()
        yield from self._postprocessing()
        yield from self._metadata_file()

    def graph_file(self, name: str, started: str, ended: str) -> Iterator[Node]:
        """Nodes of the graph file itself.

        Args:
            name: the file's name.
            started: when writing began.
            ended: when the file was complete.
        """
        yield _file_activity(
            "graph/", "robovast:PostprocessingGraph", ["metadata.yaml"], started, ended
        )
        yield {
            "@id": name,
            "@type": ["Entity", "robovast:Campaign#Graph"],
            "wasGeneratedBy": f"{POSTPROCESSING}graph/",
        }

    def _results(self) -> Iterator[dict[str, Any]]:
        for entry in self._metadata["configurations"]:
            yield from entry.get("test_results") or ()

    def _campaign(self) -> Iterator[Node]:
        execution = _section(self._metadata, "execution")
        started = as_utc(execution.get("execution_time"))
        ends = [end for result in self._results() if (end := result.get("end_time"))]
        ended = max(ends, default=None)
        kind = "Cluster" if execution.get("execution_type") == "cluster" else "Local"
        yield compact(
            {
                "@id": EXECUTION,
                "@type": ["Activity", "robovast:CampaignExecution", f"robovast:{kind}"],
                "startedAtTime": started,
                "endedAtTime": ended if ended and started and ended >= started else None,
                "used": self._run_files(),
                "wasAssociatedWith": list(dict.fromkeys([SOFTWARE, *self._agents])),
                "runs": execution.get("runs"),
                "image": execution.get("image"),
                "image_revision": execution.get("image_revision"),
            }
        )
        about = {key: self._description.get(key) for key in ("title", "description")}
        yield compact(
            {
                "@id": self.iri,
                "@type": ["Entity", "robovast:Campaign"],
                "wasGeneratedBy": EXECUTION,
                **{key: str(value) for key, value in about.items() if value},
                "license": _iri_or_text(self._description.get("license")),
                "creator": [{"@id": person["@id"]} for person in self._people],
            }
        )

    def _run_files(self) -> list[str]:
        listed = self._metadata.get("run_files") or ()
        return [iri for iri in map(path_iri, map(str, listed)) if iri != self._scenario]

    def _inputs(self) -> Iterator[Node]:
        names = [self._metadata.get("vast_file"), self._metadata.get("scenario_file")]
        if self._vast:
            yield self._vast_file(str(names[0]))
            for name in self._entries():
                yield {"@id": self._logical(name), "@type": ["Entity", "smm:LogicalScenario"]}
        if self._scenario:
            kinds = ["Entity", "smm:AbstractScenario", f"{SCENARIOS}AbstractScenario"]
            yield {"@id": self._scenario, "@type": kinds}
        for iri in self._run_files():
            yield {"@id": iri, "@type": ["Entity"]}

    def _vast_file(self, name: str) -> Node:
        return compact(
            {
                "@id": self._vast,
                "@type": ["Entity", "Collection", "robovast:VastConfiguration"],
                "references": self._scenario,
                "hadMember": [self._logical(entry) for entry in self._entries()],
                "wasAttributedTo": [person["@id"] for person in self._people],
                "modified": self._modified(name),
            }
        )

    def _modified(self, name: str) -> str | None:
        """When a file of `_config` was last modified.

        A file that was copied afterwards has the time of the execution, when the campaign took it.
        """
        executed = as_utc(_section(self._metadata, "execution").get("execution_time"))
        try:
            changed = from_epoch((self._root / name).stat().st_mtime)
        except OSError:
            return executed
        return min(filter(None, (changed, executed)), default=None)

    def _entries(self) -> list[str]:
        names = (entry.get("derived_from") for entry in self._metadata["configurations"])
        return [str(name) for name in dict.fromkeys(names) if name]

    def _logical(self, entry: str) -> str:
        return f"{self._vast}#{path_iri(entry)}"

    def _generation(self) -> Node:
        times = [
            variation_times(record)
            for entry in self._metadata["configurations"]
            for record in entry.get("variations") or ()
        ]
        return compact(
            {
                "@id": GENERATION,
                "@type": ["Activity", "robovast:ConfigGeneration"],
                "used": [iri for iri in (self._vast, self._scenario) if iri],
                "wasInfluencedBy": EXECUTION,
                "wasAssociatedWith": SOFTWARE,
                "startedAtTime": min((start for start, _ in times if start), default=None),
                "endedAtTime": max((end for _, end in times if end), default=None),
            }
        )

    def _configuration(self, entry: dict[str, Any]) -> Iterator[Node]:
        name = entry["name"]
        iri = path_iri(f"{name}/")
        contributed, properties, used = self._contributions(entry)
        yield from contributed
        files = [path_iri(str(file)) for file in entry.get("config_files") or ()]
        yield with_properties(self._scenario_node(entry, iri, files), properties)
        location = path_iri(f"{name}/{SCENARIO_CONFIG}")
        yield {"@id": location, "@type": ["Entity", "prov:Location"]}
        made = self._generated_by_hooks(contributed)
        for file in files:
            node = {"@id": file, "@type": ["Entity"]}
            yield node if file in made else {**node, "wasGeneratedBy": GENERATION}
        yield from self._variations(entry)
        for result in entry.get("test_results") or ():
            yield from self._run(result, [iri, *files, *used])

    def _generated_by_hooks(self, nodes: Iterable[Node]) -> set[str]:
        """IRIs, relative to the campaign, of entities that a hook's activities generated."""
        return {
            str(node.get("@id", "")).removeprefix(self.iri)
            for node in nodes
            if "wasGeneratedBy" in node
        }

    def _scenario_node(self, entry: dict[str, Any], iri: str, files: list[str]) -> Node:
        origin, decision = entry.get("derived_from"), entry.get("decision") or {}
        return compact(
            {
                "@id": iri,
                "@type": ["Entity", "smm:ConcreteScenario"],
                "wasGeneratedBy": GENERATION,
                "specializationOf": self._scenario,
                "atLocation": path_iri(f"{entry['name']}/{SCENARIO_CONFIG}"),
                "generatedAtTime": as_utc(entry.get("created_at")),
                "wasDerivedFrom": self._logical(str(origin)) if origin and self._vast else None,
                "references": files,
                "variations": [activity for activity, _ in self._applied(entry)],
                "config_identifier": entry.get("config_identifier"),
                "factor": factor_nodes(entry.get("factors")),
                "decision": decision.get("state"),
                "decision_runs": decision.get("runs"),
            }
        )

    def _applied(self, entry: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
        """A configuration's variations, with the IRI of each application."""
        seen: Counter[str] = Counter()
        for record in entry.get("variations") or ():
            kind = _kind(record)
            seen[kind] += 1
            number = f"-{seen[kind]}" if seen[kind] > 1 else ""
            yield path_iri(f"{entry['name']}/variations/{kind}{number}"), record

    def _variations(self, entry: dict[str, Any]) -> Iterator[Node]:
        for iri, record in self._applied(entry):
            start, end = variation_times(record)
            yield compact(
                {
                    "@id": iri,
                    "@type": ["Activity", "robovast:Variation", f"robovast:{_kind(record)}"],
                    "startedAtTime": start,
                    "endedAtTime": end,
                    "wasInfluencedBy": GENERATION,
                }
            )

    def _run(self, result: dict[str, Any], used: Iterable[str]) -> Iterator[Node]:
        yield from self._once(sysinfo_node(result))
        yield from run_nodes(
            result,
            used,
            self._agents,
            self._derivations.get(result["dir"], []),
            alone=self._is_alone(result),
        )

    def _is_alone(self, result: dict[str, Any]) -> bool:
        """True if no other run shares the run's job."""
        return self._runs_of_job[result.get("job")] == 1

    def _once(self, node: Node | None) -> Iterator[Node]:
        """A node, unless an equal one was written already."""
        if node is None:
            return
        text = json.dumps(node, default=str)
        if text not in self._written:
            self._written.add(text)
            yield node

    def _contributions(self, entry: dict[str, Any]) -> tuple[list[Node], list[Node], list[str]]:
        """The hooks' nodes, properties of the scenario and IRIs used by runs."""
        nodes: list[Node] = []
        properties: list[Node] = []
        used: list[str] = []
        applied = applied_variations(entry)
        if not self._hooks.any_contributes(applied):
            return nodes, properties, used
        from rdflib import Namespace

        campaign = Namespace(self.iri)
        variant = Namespace(f"{self.iri}{path_iri(entry['name'])}/")
        context = (campaign, variant, self.iri + GENERATION, self.iri + (self._vast or ""))
        whole = {**self._extras.get(entry["name"], {}), **entry}
        for who, found in self._hooks.contributions(applied, whole, *context):
            plain = self._findings.call(who, entry["name"], _plain_contribution, found)
            if plain is not None:
                nodes += plain[0]
                properties.append(plain[1])
                used += plain[2]
        declared = [{"@id": iri, "@type": ["Entity"]} for iri in used]
        fresh = [node for one in [*nodes, *declared] for node in self._once(one)]
        return fresh, properties, used

    def _jobs(self) -> Iterator[Node]:
        """Nodes of jobs with several runs, whose output belongs to no single run."""
        described = set()
        for result in self._results():
            job = result.get("job")
            if not job or job in described or self._is_alone(result):
                continue
            described.add(job)
            iri = path_iri(f"{job}/")
            yield {
                "@id": iri,
                "@type": ["Activity", "robovast:JobExecution"],
                "wasInfluencedBy": EXECUTION,
                "wasAssociatedWith": self._agents,
            }
            yield from job_files(result, iri)

    def _postprocessing(self) -> Iterator[Node]:
        if not self._derivations:
            return
        own: list[Derivation] = self._derivations.get("", [])
        yield from derivation_nodes(POSTPROCESSING, own, (), ())
        record = _section(self._metadata, "postprocessing")
        yield compact(
            {
                "@id": POSTPROCESSING,
                "wasInfluencedBy": EXECUTION,
                "startedAtTime": as_utc(record.get("started_at")),
                "endedAtTime": as_utc(record.get("ended_at")),
            }
        )

    def _metadata_file(self) -> Iterator[Node]:
        generated = _section(self._metadata, "generated")
        used = [name for name in _RECORDS if os.path.isfile(self._root / name)]
        yield from ({"@id": name, "@type": ["Entity"]} for name in used)
        times = (as_utc(generated.get("started_at")), as_utc(generated.get("ended_at")))
        yield _file_activity("metadata/", "robovast:PostprocessingMetadata", used, *times)
        yield {
            "@id": "metadata.yaml",
            "@type": ["Entity", "robovast:Campaign#Metadata"],
            "wasGeneratedBy": f"{POSTPROCESSING}metadata/",
        }


def _plain_contribution(found: Any) -> tuple[list[Node], Node, list[str]]:
    return (
        [plain_node(node) for node in found.graph_nodes],
        plain_node(found.scenario_properties),
        [plain_iri(iri) for iri in found.run_used_iris],
    )


def factor_nodes(factors: Any) -> list[Node]:
    """What was varied; structured values as JSON text."""
    units = factor_units(factors)
    return [
        plain_node(
            compact(
                {
                    "@type": "robovast:Factor",
                    "name": name,
                    "value": json.dumps(value) if isinstance(value, dict | list) else value,
                    "unit": units.get(name),
                }
            )
        )
        for name, value in factor_values(factors).items()
    ]


def _kind(record: dict[str, Any]) -> str:
    """Name of a variation type; for one in a file, the name of its class."""
    return str(record.get("name")).rpartition(":")[2]


def _file_activity(
    name: str, kind: str, used: list[str], started: str | None, ended: str | None
) -> Node:
    return compact(
        {
            "@id": f"{POSTPROCESSING}{name}",
            "@type": ["Activity", kind],
            "used": used,
            "wasInfluencedBy": EXECUTION,
            "wasAssociatedWith": SOFTWARE,
            "startedAtTime": started,
            "endedAtTime": ended,
        }
    )


def _optional_iri(path: Any) -> str | None:
    return path_iri(str(path)) if path else None


def _iri_or_text(value: Any) -> Any:
    if not value:
        return None
    return {"@id": value} if is_iri(value) else str(value)
