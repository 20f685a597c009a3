"""Simple YAML is written as PyYAML writes it."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from robovast.base.plain_yaml import NotSimpleError, dump_simple
from robovast.base.serialization import dump_yaml

WORDS = st.sampled_from(
    ["y", "No", "ON", "null", "Null", "~", "0b1", "1e5", ".inf", "nan", "_", "a-", "0x1f", "007"]
)
NAMES = st.one_of(
    st.from_regex(r"[A-Za-z_/][A-Za-z0-9_./-]{0,20}", fullmatch=True),
    st.from_regex(r"[0-9a-f]{64}", fullmatch=True),
    st.text(alphabet="ab01 .-_/yno:", max_size=12),
    st.datetimes().map(lambda time: time.replace(tzinfo=UTC).isoformat()),
    WORDS,
)
DATA = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), NAMES),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(NAMES, inner, max_size=4)),
    max_leaves=12,
)


def by_pyyaml(data: Any) -> str:
    text: str = yaml.dump(
        data, Dumper=yaml.CSafeDumper, sort_keys=False, allow_unicode=True, width=2**31 - 1
    )
    return text


@settings(max_examples=300, deadline=None)
@given(DATA)
def test_what_is_simple_is_written_as_pyyaml_writes_it(data: Any) -> None:
    try:
        written = dump_simple(data)
    except NotSimpleError:
        return
    assert written == by_pyyaml(data)


def test_what_campaigns_are_made_of_is_simple() -> None:
    record = {
        "name": "hall-3-2",
        "config": {"speed": 0.5, "small": 1e-07, "goals": [[1, 2.5], []], "map": "/config/a.yaml"},
        "_config_files": [{"name": "maps/a.yaml", "empty": {}}],
        "started_at": datetime(2026, 3, 10, tzinfo=UTC).isoformat(),
        "identifier": "7" * 63 + "a",
        "nothing": None,
    }
    assert dump_simple([record]) == by_pyyaml([record]) == dump_yaml([record])


@pytest.mark.parametrize("data", [{"a": "b: c"}, {1: 2}, ["é"], "text", {"a": float("nan")}, {}])
def test_the_rest_is_left_to_pyyaml(data: Any) -> None:
    with pytest.raises(NotSimpleError):
        dump_simple(data)
    assert dump_yaml(data) == by_pyyaml(data)
