"""Configurations in cells of two factors: how many runs of each cell did not pass. Pure functions.

The page makes the same of the columns that it has (`web/src/data.ts`), since users choose there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robovast.campaign.verdict import Verdict
from robovast.evaluation.effects import as_text, is_number
from robovast.evaluation.summaries import VariantRuns
from robovast.evaluation.untrusted_data import mapping

MOST_GROUPS = 24
"""Numbers with more different values are put in ranges."""
RANGES = 10
_REST = "others"


@dataclass(frozen=True)
class FactorAxis:
    """Groups of configurations by the values of a factor."""

    factor: str
    """Empty if all configurations are in one group."""
    labels: list[str]
    group: list[int]
    """Place in the labels for each configuration."""


@dataclass(frozen=True, slots=True)
class Cell:
    """The runs of the configurations with these values."""

    bad: int = 0
    """Runs that failed or errored."""
    runs: int = 0
    """Runs with a verdict."""


@dataclass(frozen=True)
class Matrix:
    """Configurations by two factors."""

    across: FactorAxis
    down: FactorAxis
    cells: list[list[Cell]]
    """Row by row."""


def matrix(variants: Sequence[VariantRuns], factors: Sequence[str]) -> Matrix:
    """Put the runs of a campaign in cells.

    Args:
        variants: its configurations.
        factors: at most two, that of the columns first.
    """
    across, down = (
        _axis(name, [variant.factors.get(name) for variant in variants])
        for name in [*factors, "", ""][:2]
    )
    counts: Counter[tuple[int, int, bool]] = Counter()
    for variant, column, row in zip(variants, across.group, down.group, strict=True):
        for run in variant.runs:
            if run.verdict is not Verdict.INTERRUPTED:
                counts[row, column, run.verdict is not Verdict.PASSED] += 1
    cells = [
        [
            Cell(counts[row, column, True], counts[row, column, True] + counts[row, column, False])
            for column in range(len(across.labels))
        ]
        for row in range(len(down.labels))
    ]
    return Matrix(across, down, cells)


def _axis(factor: str, values: Sequence[Any]) -> FactorAxis:
    if not factor:
        return FactorAxis("", [""], [0] * len(values))
    different = sorted({as_text(value): value for value in values}.items(), key=_in_order)
    numbers = [value for _, value in different if is_number(value)]
    if len(different) > MOST_GROUPS and len(numbers) == len(different):
        return _ranges(factor, values, numbers)
    place = {text: min(n, MOST_GROUPS) for n, (text, _) in enumerate(different)}
    labels = [value_label(value) for _, value in different[:MOST_GROUPS]]
    rest = [_REST] if len(different) > MOST_GROUPS else []
    return FactorAxis(factor, labels + rest, [place[as_text(value)] for value in values])


def _in_order(item: tuple[str, Any]) -> tuple[Any, ...]:
    return _rank(item[1])


def _rank(value: Any) -> tuple[Any, ...]:
    """Sorts numbers by size, then texts, then lists item by item; what is missing comes last."""
    if is_number(value):
        return 0, value
    if isinstance(value, list | tuple):
        return 2, [_rank(item) for item in value]
    return (3,) if value is None else (1, as_text(value))


def value_label(value: Any) -> str:
    """A value as people read it; of a pose, its place."""
    if is_number(value):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        place = mapping(value.get("position", value))
        if is_number(place.get("x")) and is_number(place.get("y")):
            return f"{place['x']:.2f}, {place['y']:.2f}"
    return "–" if value is None else as_text(value)


def _ranges(factor: str, values: Sequence[float], ordered: Sequence[float]) -> FactorAxis:
    """Ranges with about as many different values each."""
    starts = [ordered[n * len(ordered) // RANGES] for n in range(RANGES)]
    ends = [*starts[1:], ordered[-1]]
    labels = [f"{start:.3g} … {end:.3g}" for start, end in zip(starts, ends, strict=True)]
    return FactorAxis(
        factor, labels, [sum(start <= value for start in starts) - 1 for value in values]
    )
