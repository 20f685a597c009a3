"""Validation rules of the CRDs: the API server names the field of each refusal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from robovast.kubeapi.crd import campaign_crd, configuration_crd


def rules(schema: dict[str, Any], path: str = "") -> Iterator[tuple[str, dict[str, Any], Any]]:
    """Walk a schema: the path of each rule, its schema, and the rule."""
    for rule in schema.get("x-kubernetes-validations", ()):
        yield path, schema, rule
    for name, inner in schema.get("properties", {}).items():
        yield from rules(inner, f"{path}.{name}")
    if isinstance(schema.get("items"), dict):
        yield from rules(schema["items"], f"{path}[]")


ALL = [
    found
    for crd in (campaign_crd(), configuration_crd())
    for found in rules(crd["spec"]["versions"][0]["schema"]["openAPIV3Schema"])
]


@pytest.mark.parametrize(("path", "schema", "rule"), ALL)
def test_a_rule_on_several_fields_names_the_field_that_it_refuses(
    path: str, schema: dict[str, Any], rule: dict[str, Any]
) -> None:
    assert rule["message"]
    if schema["type"] != "object":
        return  # the path of a rule on a single value is that value
    inner: dict[str, Any] = schema
    for name in rule["fieldPath"].removeprefix(".").split("."):
        inner = inner["properties"][name]
    assert inner, path
