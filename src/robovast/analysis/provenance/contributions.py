"""Converts contributions of hooks to JSON-LD."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from datetime import date, datetime
from typing import Any

from robovast.analysis.provenance.vocabulary import encode_iri, term_of
from robovast.base.serialization import to_plain

Node = dict[str, Any]


def plain_node(node: Any) -> Node:
    """Convert a hook's node: keys become terms of the context, rdflib's values become JSON-LD.

    Raises:
        TypeError: it is not a mapping, or has a value that JSON-LD cannot express.
    """
    if not isinstance(node, Mapping):
        raise TypeError(f"a graph node must be a dict, not {node!r}")
    return {_key(key): _member(_key(key), value) for key, value in node.items()}


def plain_iri(iri: Any) -> str:
    """Validate an IRI of a hook.

    Raises:
        TypeError: it is not text.
    """
    if not isinstance(iri, str):
        raise TypeError(f"an IRI must be text, not {iri!r}")
    return encode_iri(str(iri))


def _key(key: Any) -> str:
    if not isinstance(key, str):
        raise TypeError(f"a property must be an IRI or a term, not {key!r}")
    return term_of(str(key))


def _member(key: str, value: Any) -> Any:
    if key == "@id":
        return plain_iri(value)
    if key == "@type":
        kinds = [value] if isinstance(value, str) else value
        return [str(kind) for kind in kinds]
    return _value(value)


def _value(value: Any) -> Any:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, float) and not math.isfinite(value):
        return {"@value": _XSD_DOUBLE[str(float(value))], "@type": "xsd:double"}
    if isinstance(value, datetime):
        return {"@value": value.isoformat(), "@type": "xsd:dateTime"}
    if isinstance(value, date):
        return {"@value": value.isoformat(), "@type": "xsd:date"}
    if isinstance(value, Mapping):
        return plain_node(value)
    if isinstance(value, list | tuple | set | frozenset):
        return [_value(item) for item in value]
    return to_plain(value)


_XSD_DOUBLE = {"nan": "NaN", "inf": "INF", "-inf": "-INF"}


def _text(value: str) -> Any:
    """Text unchanged; rdflib's IRIs, blank nodes and literals, which are text too, as JSON-LD."""
    kind = type(value).__name__
    if kind in {"URIRef", "Namespace"}:
        return {"@id": encode_iri(str(value))}
    if kind == "BNode":
        return {"@id": f"_:{value}"}
    if kind == "Literal":
        return _literal(value)
    return str(value)


def _literal(value: Any) -> dict[str, Any]:
    literal = {"@value": str(value)}
    if value.language:
        return {**literal, "@language": value.language}
    return {**literal, "@type": str(value.datatype)} if value.datatype else literal


def with_properties(node: Node, properties: Iterable[Node]) -> Node:
    """Add properties to a node; values of existing properties are appended."""
    merged = dict(node)
    for key, value in (item for one in properties for item in one.items()):
        merged[key] = [*_several(merged[key]), *_several(value)] if key in merged else value
    return merged


def _several(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]
