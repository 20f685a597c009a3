"""Cells of converted messages."""

from __future__ import annotations

import struct
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.analysis.bags.definitions import Definition, types_of
from robovast.analysis.bags.flatten import compile_flatten, number_cells, seconds_cell


@given(st.integers(-(2**63), 2**63 - 1))
def test_a_time_is_written_without_rounding(nanoseconds: int) -> None:
    assert Decimal(seconds_cell(nanoseconds).decode()) * 10**9 == nanoseconds


def test_an_array_without_numbers_has_no_cell() -> None:
    assert number_cells(()) == []
    assert number_cells((1.0, 2.0)) == [b"1.0", b"2.0"]


@pytest.mark.parametrize("field", ["string[] v", "uint8[] v", "p/Item[] v"])
def test_a_message_has_at_most_as_many_values_as_a_table_has_columns(field: str) -> None:
    """A sequence of empty items takes no space in a compressed bag."""
    items = "=" * 80 + "\nMSG: p/Item\nuint8[] x\n"
    types = types_of(Definition("p/msg/T", "ros2msg", f"{field}\n{items}"), None, "jazzy")
    flatten = compile_flatten("p/msg/T", types)
    size = 1 if field.startswith("uint8") else 4
    assert flatten(struct.pack("<I", 9) + bytes(9 * size), [])[0] == 9
    cells: list[bytes] = []
    with pytest.raises(ValueError, match="more than 1,048,576 values"):
        flatten(struct.pack("<I", 3 << 20) + bytes((3 << 20) * size), cells)
    assert len(cells) <= (1 << 20) + 1
