"""Agents in the graph: RoboVAST, the robots of a campaign, and its creators."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from robovast.analysis.provenance.contributions import Node
from robovast.analysis.provenance.vocabulary import SOFTWARE, encode_iri, is_iri, path_iri
from robovast.base.serialization import to_plain
from robovast.base.version import __version__
from robovast.model.naming import CONFIG

_ORCID = re.compile(r"^(?:https?://orcid\.org/)?(\d{4}-\d{4}-\d{4}-\d{3}[\dX])$")
_OWN_KEYS = frozenset({"id", "name", "type", "configuration_files"})


def software() -> Node:
    """RoboVAST itself."""
    return {"@id": SOFTWARE, "@type": ["Agent", "SoftwareAgent"], "hasVersion": __version__}


def systems(agents: Any, dataset: str) -> list[Node]:
    """The systems under test that `metadata.agents` lists.

    Args:
        agents: mappings with a `name` or an `id`, and any other keys.
        dataset: IRI of the dataset.
    """
    listed = [agent for agent in _several(agents) if isinstance(agent, dict)]
    return [_system(agent, dataset) for agent in listed if agent.get("id") or agent.get("name")]


def _system(agent: dict[str, Any], dataset: str) -> Node:
    free = {key: value for key, value in agent.items() if key not in _OWN_KEYS}
    node: Node = {
        "@id": _iri(agent.get("id") or agent["name"], dataset),
        "@type": "Agent",
        "foaf:name": str(agent.get("name") or agent["id"]),
        **{f"agn:{_word(key)}": _plain_value(value) for key, value in free.items()},
    }
    if agent.get("type"):
        node["agn:type"] = str(agent["type"])
    files = [path_iri(f"{CONFIG}/{file}") for file in _several(agent.get("configuration_files"))]
    return {**node, "agn:configuration_files": [{"@id": file} for file in files]} if files else node


def people(creators: Any, dataset: str) -> list[Node]:
    """Persons from names, ORCIDs, mappings with `name` and `id` or `orcid`, or a list of these.

    Args:
        creators: the creators as written in the .vast file.
        dataset: IRI of the dataset.
    """
    return [_person(creator, dataset) for creator in _several(creators) if creator]


def _person(creator: Any, dataset: str) -> Node:
    given = creator if isinstance(creator, dict) else {"name": str(creator)}
    name = given.get("name")
    identity = given.get("orcid") or given.get("id") or name or "unknown"
    orcid = _ORCID.match(str(identity))
    iri = f"https://orcid.org/{orcid[1]}" if orcid else _iri(identity, dataset)
    node: Node = {"@id": iri, "@type": ["Agent", "Person"]}
    return {**node, "foaf:name": str(name)} if name and not _ORCID.match(str(name)) else node


def _iri(identity: Any, dataset: str) -> str:
    text = str(identity)
    return encode_iri(text) if is_iri(text) else f"{dataset}#{path_iri(text.replace(' ', '_'))}"


def _word(key: Any) -> str:
    return re.sub(r"\W+", "_", str(key))


def _plain_value(value: Any) -> Any:
    return value if isinstance(value, str | int | float | bool) else str(to_plain(value))


def _several(value: Any) -> Iterable[Any]:
    if value is None:
        return []
    return value if isinstance(value, list) else [value]
