"""Factors in the provenance graph."""

from __future__ import annotations

import json
import math

from robovast.analysis.provenance.graph import factor_nodes


def test_factors_of_any_value_are_valid_json() -> None:
    values = {"a": math.nan, "b": -math.inf, "c": 0, "d": [math.nan], "e": "brick"}
    nodes = factor_nodes({name: {"value": value} for name, value in values.items()})
    text = json.dumps(nodes, allow_nan=False)
    assert [node["value"] for node in json.loads(text)] == [
        {"@value": "NaN", "@type": "xsd:double"},
        {"@value": "-INF", "@type": "xsd:double"},
        0,
        "[NaN]",
        "brick",
    ]
