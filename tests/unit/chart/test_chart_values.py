"""The chart's values, and the schema that refuses others."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from robovast_testbed import programs

CHART = Path(__file__).parents[3] / "helm/robovast"
VALUES: dict[str, Any] = yaml.safe_load((CHART / "values.yaml").read_text())
SCHEMA: dict[str, Any] = json.loads((CHART / "values.schema.json").read_text())

ELSEWHERE = {"global"}
"""Helm gives it to charts that are part of another."""


def resolved(schema: dict[str, Any]) -> dict[str, Any]:
    name = schema.get("$ref", "").rpartition("/")[2]
    return {**SCHEMA["$defs"].get(name, {}), **schema}


def described(schema: dict[str, Any], path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every key that a schema names, by path."""
    for name, part in schema.get("properties", {}).items():
        found = resolved(part)
        yield f"{path}.{name}".lstrip("."), found
        if "$ref" not in part:
            yield from described(found, f"{path}.{name}")


def given(values: dict[str, Any], known: dict[str, dict[str, Any]], path: str = "") -> set[str]:
    """Every key of the values down to what users fill as they like, by path."""
    paths = set()
    for name, value in values.items():
        here = f"{path}.{name}".lstrip(".")
        paths.add(here)
        if isinstance(value, dict) and any(other.startswith(f"{here}.") for other in known):
            paths |= given(value, known, here)
    return paths


def test_the_schema_and_the_values_have_the_same_keys() -> None:
    known = dict(described(SCHEMA))
    assert given(VALUES, known) == known.keys() - ELSEWHERE


def test_every_value_is_described() -> None:
    assert [path for path, schema in described(SCHEMA) if not schema.get("description")] == []


def test_no_object_takes_keys_that_nobody_described() -> None:
    free = {
        path
        for path, schema in described({"properties": {"values": SCHEMA}})
        if schema["type"] == "object" and schema.get("additionalProperties") is not False
    }
    assert free == {
        "values.global",
        "values.example.scheduling",
        "values.scheduling.affinity",
        "values.scheduling.nodeSelector",
        "values.kueue.resources",
        "values.metrics.serviceMonitor.labels",
        "values.metrics.prometheusRule.labels",
        "values.metrics.grafanaDashboard.labels",
    }


def test_the_s3_gateway_is_the_version_that_is_tested() -> None:
    assert (
        VALUES["storage"]["embedded"]["image"]
        .partition("@")[0]
        .endswith(f":{programs.VERSITYGW.version}")
    )
