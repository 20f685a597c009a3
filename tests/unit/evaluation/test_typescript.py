"""Types of the web UI follow from those of the server."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Literal, NamedTuple

import pytest

from robovast.evaluation.server.typescript import HEADER, type_declarations


class Color(StrEnum):
    RED = "red"
    BLUE = "blue"


class Line(NamedTuple):
    number: int
    text: str


@dataclass(frozen=True)
class Base:
    """A base."""

    name: str


@dataclass(frozen=True)
class Sample(Base):
    """A sample, for example
    of two lines.

    More."""

    color: Color
    counts: Mapping[Color, int]
    lines: Sequence[Line]
    choice: Literal["a", "b"] | None
    several: list[int | str]
    pair: tuple[float, bool]
    anything: dict[str, Any]
    hidden: int = field(default=0, repr=False)


@dataclass(frozen=True)
class Unknown:
    value: complex


def test_each_kind_of_type_is_written() -> None:
    assert type_declarations([Sample]) == HEADER + EXPECTED


def test_a_type_without_counterpart_is_an_error() -> None:
    with pytest.raises(TypeError, match="complex"):
        type_declarations([Unknown])


EXPECTED = """
export type Color = "red" | "blue";

/** Line(number, text) */
export type Line = [number: number, text: string];

/** A sample, for example of two lines. */
export interface Sample {
  name: string;
  color: Color;
  counts: Record<Color, number>;
  lines: Line[];
  choice: "a" | "b" | null;
  several: (number | string)[];
  pair: [number, boolean];
  anything: Record<string, unknown>;
}
"""
