"""Answers stay below their limit whatever is in them, and say what is missing."""

from __future__ import annotations

import json
import math
from datetime import UTC, datetime
from decimal import Decimal
from typing import Any

import pytest

from robovast.mcp.bounds import MOST_BYTES, fitted, page, size


def nested(depth: int) -> Any:
    value: Any = "end"
    for _ in range(depth):
        value = [value]
    return value


@pytest.mark.parametrize(
    "value",
    [
        "x" * 100_000,
        "ü" * 100_000,
        '"\\\n' * 100_000,
        ["x" * 1000] * 300,
        {f"key {i}": list(range(100)) for i in range(500)},
        {"k" * 100_000: "v"},
        [[[["x" * 50] * 10] * 10] * 10] * 10,
    ],
)
def test_whatever_is_too_long_is_cut_and_says_so(value: Any) -> None:
    answer = fitted(value)
    assert size(answer) <= MOST_BYTES
    assert "cut" in json.dumps(answer, ensure_ascii=False)


def test_what_fits_stays_as_it_is() -> None:
    value = {"a": [1, 2.5, None, True, "text"], "b": {"c": "d" * 5000}}
    assert fitted(value) == value


def test_every_value_can_be_sent() -> None:
    values = [math.nan, math.inf, b"\xff", Decimal("1.5"), datetime(2026, 1, 1, tzinfo=UTC), object]
    json.dumps(fitted([*values, "\ud800"]), allow_nan=False).encode()
    assert fitted(math.nan) is None
    assert "too deeply" in json.dumps(fitted(nested(30)))
    assert "too deeply" in json.dumps(fitted({"x": nested(900)}))
    assert fitted({"\ud800": {"\ud800": 1}}) == {"?": {"?": 1}}


def test_pages_hold_every_item_once() -> None:
    items = [f"{i} " + "x" * (i % 700) for i in range(500)]
    seen: list[str] = []
    while True:
        answer = page(items, len(seen))
        assert size(answer) <= MOST_BYTES + 500
        assert answer["total"] == 500
        seen += answer["items"]
        if "cut" not in answer:
            break
        assert answer["cut"].endswith(f"offset={len(seen)}")
    assert seen == items


def test_an_offset_beyond_the_end_is_an_empty_page() -> None:
    assert page([1, 2], 9) == {"items": [], "total": 2}
    assert page([1, 2], -3) == {"items": [1, 2], "total": 2}
