"""Cells of converted messages."""

from __future__ import annotations

from decimal import Decimal

from hypothesis import given
from hypothesis import strategies as st

from robovast.analysis.bags.flatten import number_cells, seconds_cell


@given(st.integers(-(2**63), 2**63 - 1))
def test_a_time_is_written_without_rounding(nanoseconds: int) -> None:
    assert Decimal(seconds_cell(nanoseconds).decode()) * 10**9 == nanoseconds


def test_an_array_without_numbers_has_no_cell() -> None:
    assert number_cells(()) == []
    assert number_cells((1.0, 2.0)) == [b"1.0", b"2.0"]
