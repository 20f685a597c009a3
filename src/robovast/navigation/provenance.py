"""Contributions of navigation variations to the provenance graph."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from urllib.parse import quote

from robovast.base.version import __version__
from robovast.model.naming import CONFIG
from robovast.model.variations import ProvContribution

Node = dict[Any, Any]

METADATA_KEY = "navigation"
"""Key in metadata.yaml for the variations' records of a configuration."""

_ENV = "https://purl.org/secorolab/metamodels/environment#"
_ROBOVAST = "https://purl.org/robovast/metamodels/"
_GENERATOR = "https://purl.org/robovast/floorplan-generator/"


def counts(config_entry: dict[str, Any]) -> ProvContribution | None:
    """The number of goals and obstacles in a configuration's scenario."""
    from rdflib import Namespace

    record = config_entry.get(METADATA_KEY) or {}
    robovast = Namespace(_ROBOVAST)
    found = {
        robovast[f"n_{what}"]: len(record[what])
        for what in ("goals", "obstacles")
        if what in record
    }
    return ProvContribution(scenario_properties=dict(found)) if found else None


def floorplan_contribution(
    config_entry: dict[str, Any], campaign: Any, config: Any, vast_id: str
) -> ProvContribution | None:
    """The floor plan of a configuration, its graph, and the files generated from it.

    Args:
        config_entry: the configuration's entry in metadata.yaml.
        campaign: namespace of the campaign.
        config: namespace of the configuration.
        vast_id: IRI of the .vast file, which refers to the model.
    """
    record = (config_entry.get(METADATA_KEY) or {}).get("floorplan")
    if not record:
        return None
    return _Graph(record, campaign, config).contribution(vast_id)


class _Graph:
    """Nodes of one floor plan in one configuration."""

    def __init__(self, record: dict[str, Any], campaign: Any, config: Any) -> None:
        from rdflib import Namespace, URIRef

        self._record = record
        self._campaign, self._config = campaign, config
        self._env, self._robovast = Namespace(_ENV), Namespace(_ROBOVAST)
        self._image = record.get("generator")
        name = quote(self._image["image"], safe="/:@") if self._image else ""
        self._generator = URIRef(_GENERATOR + name)
        self._model = campaign[record["model"]]
        self._files = {
            key: config[f"{CONFIG}/{record[key]}"] for key in ("map_file", "image", "mesh_file")
        }
        self._graph = [config[f"{CONFIG}/{name}"] for name in record["graph"]]

    def contribution(self, vast_id: str) -> ProvContribution:
        """All nodes, references of the scenario, and entities that runs use."""
        from rdflib import DCTERMS

        nodes = [
            *self._models(),
            *self._people(),
            *self._transformation(),
            *self._generation(),
            {"@id": vast_id, DCTERMS["references"]: self._model},
        ]
        files = list(self._files.values())
        return ProvContribution(nodes, {DCTERMS["references"]: [self._model, *files]}, files)

    def _models(self) -> Iterator[Node]:
        from rdflib import PROV

        kinds = [PROV["Entity"], self._env["Environment"], self._env["FloorPlanModel"]]
        described = {"@id": self._model, "@type": kinds, **self._description()}
        base = self._record.get("base")
        if base:
            described[PROV["wasDerivedFrom"]] = self._campaign[base]
            yield {"@id": self._campaign[base], "@type": kinds, **self._description()}
        yield described

    def _description(self) -> Node:
        from rdflib import DCTERMS, PROV

        record = self._record
        creators = [self._person(person) for person in record["creators"]]
        others = [self._person(person) for person in record["contributors"]]
        found: Node = {
            DCTERMS["modified"]: _time(record["modified"]),
            DCTERMS["license"]: record.get("license"),
            DCTERMS["description"]: record.get("description"),
            DCTERMS["creator"]: creators,
            DCTERMS["contributor"]: others,
            PROV["wasAttributedTo"]: [*creators, *others],
        }
        return {key: value for key, value in found.items() if value}

    def _people(self) -> Iterator[Node]:
        from rdflib import FOAF, PROV

        for person in (*self._record["creators"], *self._record["contributors"]):
            kinds = [PROV["Person"], PROV["Agent"]]
            yield {"@id": self._person(person), "@type": kinds, FOAF["name"]: person["name"]}

    def _person(self, person: dict[str, str]) -> Any:
        from rdflib import URIRef

        if "orcid" in person:
            return URIRef(f"https://orcid.org/{person['orcid']}")
        return self._campaign["agents/" + "-".join(person["name"].split())]

    def _transformation(self) -> Iterator[Node]:
        """The activity that makes the graph from the model."""
        from rdflib import DCTERMS, PROV

        activity = self._config["jsonld_generation/"]
        kinds = [PROV["Agent"], PROV["SoftwareAgent"]]
        version = self._image["digest"] if self._image else __version__
        yield {"@id": self._generator, "@type": kinds, DCTERMS["hasVersion"]: version}
        yield self._activity(activity, "FloorPlanTransformation", [self._model])
        for iri in self._graph:
            yield self._generated(iri, "FloorPlanGraphModel", activity)

    def _generation(self) -> Iterator[Node]:
        """The activity that makes map and mesh from the graph."""
        activity = self._config["artefact_generation/"]
        yield self._activity(activity, "FloorPlanGeneration", self._graph)
        yield self._generated(self._files["image"], "OccupancyGrid", activity)
        yield {
            **self._generated(self._files["map_file"], "Metadata", activity),
            self._env["resolution"]: self._record["resolution"],
        }
        yield self._generated(self._files["mesh_file"], "Mesh3D", activity)

    def _activity(self, iri: Any, kind: str, used: list[Any]) -> Node:
        from rdflib import PROV

        return {
            "@id": iri,
            "@type": [PROV["Activity"], self._robovast[kind]],
            PROV["used"]: used,
            PROV["wasAssociatedWith"]: self._generator,
        }

    def _generated(self, iri: Any, kind: str, activity: Any) -> Node:
        from rdflib import PROV

        return {
            "@id": iri,
            "@type": [PROV["Entity"], self._env[kind]],
            PROV["wasGeneratedBy"]: activity,
        }


def _time(text: str) -> Any:
    from rdflib import XSD, Literal

    return Literal(text, datatype=XSD.dateTime if "T" in text else XSD.date)
