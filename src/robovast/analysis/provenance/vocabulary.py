"""The terms of the graph and its JSON-LD context."""

from __future__ import annotations

import re
from typing import Any

ROBOVAST = "https://purl.org/robovast/metamodels/"
SOFTWARE = "https://purl.org/robovast/"
"""RoboVAST as an agent."""
DEFAULT_DATASET = "https://purl.org/robovast/datasets/default/"

PREFIXES = {
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
    "xsd": "http://www.w3.org/2001/XMLSchema#",
    "prov": "http://www.w3.org/ns/prov#",
    "dcterms": "http://purl.org/dc/terms/",
    "dcat": "http://www.w3.org/ns/dcat#",
    "foaf": "http://xmlns.com/foaf/0.1/",
    "robovast": ROBOVAST,
    "smm": "https://purl.org/secorolab/metamodels/scenarios/osc/",
    "scenarios": "https://purl.org/secorolab/metamodels/scenarios/osc/",
    "env": "https://purl.org/secorolab/metamodels/environment#",
    "agn": "https://purl.org/secorolab/metamodels/agent#",
    "qudt": "http://qudt.org/schema/qudt/",
    "unit": "http://qudt.org/vocab/unit/",
}
"""Prefixes of queries."""

SCENARIOS = "https://purl.org/secorolab/metamodels/scenarios/osc#"
"""The value of `scenarios:` in the file's context.

rdflib keeps one prefix per IRI, so only one of `smm:` and `scenarios:` would work in queries
without PREFIX lines. The class `scenarios:AbstractScenario` is declared under both IRIs.
"""

_LINKS = {
    "prov": (
        "actedOnBehalfOf", "alternateOf", "atLocation", "generated", "hadMember", "hadPlan",
        "hadPrimarySource", "influenced", "invalidated", "specializationOf", "used",
        "wasAssociatedWith", "wasAttributedTo", "wasDerivedFrom", "wasEndedBy", "wasGeneratedBy",
        "wasInfluencedBy", "wasInformedBy", "wasInvalidatedBy", "wasQuotedFrom", "wasRevisionOf",
        "wasStartedBy",
    ),
    "dcterms": ("contributor", "isPartOf", "references"),
    "robovast": ("job", "sysinfo"),
}  # fmt: skip
_TIMES = {
    "prov": ("endedAtTime", "generatedAtTime", "invalidatedAtTime", "startedAtTime"),
    "dcterms": ("modified",),
}
_VALUES = {
    "prov": (
        "Activity", "Agent", "Bundle", "Collection", "Entity", "Organization", "Person",
        "SoftwareAgent",
    ),
    "dcterms": ("creator", "description", "hasVersion", "license", "title"),
}  # fmt: skip


def _terms() -> dict[str, Any]:
    terms: dict[str, Any] = {}
    for prefix, names in _VALUES.items():
        terms.update({name: f"{prefix}:{name}" for name in names})
    for kind, groups in (("@id", _LINKS), ("xsd:dateTime", _TIMES)):
        for prefix, names in groups.items():
            terms.update({name: {"@id": f"{prefix}:{name}", "@type": kind} for name in names})
    variations = {"@id": "robovast:variations", "@type": "@id", "@container": "@list"}
    return {**terms, "variations": variations}


TERMS = _terms()


def context(base: str) -> dict[str, Any]:
    """The whole JSON-LD context.

    Args:
        base: IRI of the campaign; IRIs in the file are relative to it.
    """
    return {"@base": base, "@vocab": ROBOVAST, **PREFIXES, "scenarios": SCENARIOS, **TERMS}


def term_of(iri: str) -> str:
    """The context's term for a property; the term's definition gives the type of its values."""
    return _TERM_OF_IRI.get(iri, iri)


def _expand(compact: str) -> str:
    prefix, _, name = compact.partition(":")
    return PREFIXES[prefix] + name


_TERM_OF_IRI = {
    _expand(term if isinstance(term, str) else term["@id"]): name for name, term in TERMS.items()
}


_ILLEGAL = re.compile(r"[\x00-\x20<>\"{}|\\^`\x7f]")
_IN_PATH = re.compile(r"[\x00-\x20<>\"{}|\\^`\x7f%?#]")
_ABSOLUTE = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]*:\S+$")


def encode_iri(iri: str) -> str:
    """Percent-encode characters that are not allowed in IRIs."""
    return _ILLEGAL.sub(_percent, iri)


def path_iri(path: str) -> str:
    """The relative IRI of a path in the campaign."""
    encoded = _IN_PATH.sub(_percent, path)
    return f"./{encoded}" if ":" in encoded.partition("/")[0] else encoded


def is_iri(text: Any) -> bool:
    """Whether a text is an absolute IRI."""
    return isinstance(text, str) and _ABSOLUTE.match(text) is not None


def _percent(match: re.Match[str]) -> str:
    return "".join(f"%{byte:02X}" for byte in match[0].encode("utf-8"))
