"""Designs: which combinations of the product of an entry's variations are made.

A combination is a tuple of positions, one in the values of each variation. What is chosen depends
on the design and the numbers of values alone, on every machine and in every version: only
`Random.getrandbits` is drawn from, and no library whose numbers may change.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import combinations, product
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from robovast.model.document.model import Design

Row = tuple[int, ...]
_Item = TypeVar("_Item")
_Pairs = dict[tuple[int, int], set[tuple[int, int]]]
"""Pairs of values that are to occur together, by their variations."""

_CANDIDATES = 10
"""Rows among which the best is taken for a pairwise design."""
_FEW_PAIRS = 5000
"""Pairs of which a pairwise design takes the time for several candidates."""
MOST_PAIRS = 100_000
"""Most pairs of values of a pairwise design."""

STRENGTHS = {1: "values", 2: "pairs", 3: "triples"}
"""What combinations of so many values are called."""
_MOST_LOOKED_AT = 20_000_000
"""Most combinations of values that are counted, in about ten seconds."""
_BITS = 32
_DIRECTIONS: tuple[tuple[int, tuple[int, ...]], ...] = (
    (0, (1,)),
    (1, (1, 3)),
    (1, (1, 3, 1)),
    (2, (1, 1, 1)),
    (1, (1, 1, 3, 3)),
    (4, (1, 3, 5, 13)),
    (2, (1, 1, 5, 5, 17)),
    (4, (1, 1, 5, 5, 5)),
    (7, (1, 1, 7, 11, 19)),
    (11, (1, 1, 5, 1, 1)),
    (13, (1, 1, 1, 3, 11)),
    (14, (1, 3, 5, 5, 31)),
    (1, (1, 3, 3, 9, 7, 49)),
    (13, (1, 1, 1, 15, 21, 21)),
    (16, (1, 3, 1, 13, 27, 49)),
)
"""Polynomials and first direction numbers of Joe and Kuo, from the second dimension on."""
MOST_SOBOL = len(_DIRECTIONS) + 1
"""Most variations of a Sobol design."""


def rows_of(design: Design, sizes: Sequence[int]) -> list[Row]:
    """The combinations of a design, in the order of the product.

    Args:
        design: which fits the product.
        sizes: number of values of each variation.
    """
    if design.kind == "full":
        return list(product(*map(range, sizes)))
    if design.kind == "pairwise":
        return sorted(_pairwise(tuple(sizes)))
    generator = random.Random(design.seed)  # noqa: S311  # repeatable on purpose
    points = _POINTS[design.kind](generator, sizes, design.count or 1)
    return sorted(_distinct(points, generator, sizes, design.count or 1))


def count_of(design: Design, sizes: Sequence[int]) -> int:
    """The number of combinations of a design."""
    if design.kind == "pairwise":
        return len(_pairwise(tuple(sizes)))
    return math.prod(sizes) if design.count is None else design.count


def coverage(rows: Sequence[Row], sizes: Sequence[int], strength: int) -> tuple[int, int]:
    """How many combinations of the values of so many variations occur, and how many there are."""
    covered = total = 0
    for axes in combinations(range(len(sizes)), strength):
        covered += len({tuple(row[axis] for axis in axes) for row in rows})
        total += math.prod(sizes[axis] for axis in axes)
    return covered, total


def coverages(rows: Sequence[Row], sizes: Sequence[int]) -> dict[str, tuple[int, int]]:
    """The coverage of values, pairs and triples, as far as it is counted in reasonable time."""
    effort = max(1, len(rows))
    return {
        words: coverage(rows, sizes, strength)
        for strength, words in STRENGTHS.items()
        if strength <= len(sizes) and math.comb(len(sizes), strength) * effort <= _MOST_LOOKED_AT
    }


def pairs_of(sizes: Sequence[int]) -> int:
    """The number of pairs of values of different variations."""
    return sum(one * two for one, two in combinations(sizes, 2))


@lru_cache(maxsize=64)
def _pairwise(sizes: Row) -> list[Row]:
    """Few rows in which each two values of different variations occur together."""
    return [(value,) for value in range(sizes[0])] if len(sizes) == 1 else completing((), sizes)


def pairs_in(row: Row) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Each two values of a row, as the positions of their variations and their own."""
    chosen = combinations(range(len(row)), 2)
    return [((one, two), (row[one], row[two])) for one, two in chosen]


def missing_pairs(rows: Iterable[Row], sizes: Sequence[int]) -> _Pairs:
    """The pairs of values that do not occur together, by the positions of their variations."""
    left = {
        (one, two): set(product(range(sizes[one]), range(sizes[two])))
        for one, two in combinations(range(len(sizes)), 2)
    }
    for row in rows:
        for axes, values in pairs_in(row):
            left[axes].discard(values)
    return left


def completing(rows: Iterable[Row], sizes: Sequence[int]) -> list[Row]:
    """Few further rows, so that each two values of different variations occur together."""
    left = missing_pairs(rows, sizes)
    in_order = {axes: iter(sorted(values)) for axes, values in left.items()}
    generator = random.Random(0)  # noqa: S311  # repeatable on purpose
    candidates = _CANDIDATES if pairs_of(sizes) <= _FEW_PAIRS else 1
    further = []
    while any(left.values()):
        axes = max(left, key=lambda pair: len(left[pair]))
        least = next(values for values in in_order[axes] if values in left[axes])
        first = dict(zip(axes, least, strict=True))
        row = _best([_filled(first, sizes, left, generator) for _ in range(candidates)], left)
        for pair, values in pairs_in(row):
            left[pair].discard(values)
        further.append(row)
    return further


def _best(candidates: Sequence[Row], left: _Pairs) -> Row:
    """The row that covers most of what is left."""
    return max(candidates, key=lambda row: sum((row[a], row[b]) in left[a, b] for a, b in left))


def _filled(
    first: Mapping[int, int], sizes: Sequence[int], left: _Pairs, generator: random.Random
) -> Row:
    """A row with the values that cover most of what is left, in any order of variations."""
    row = dict(first)
    axes = [axis for axis in range(len(sizes)) if axis not in row]
    _shuffle(axes, generator)
    for axis in axes:
        gains = [_gain(axis, value, row, left) for value in range(sizes[axis])]
        row[axis] = gains.index(max(gains))
    return tuple(row[axis] for axis in range(len(sizes)))


def _gain(axis: int, value: int, row: Mapping[int, int], left: _Pairs) -> int:
    """How many pairs that are left a value makes with those of the row."""
    return sum(
        ((other, value) in left[at, axis]) if at < axis else ((value, other) in left[axis, at])
        for at, other in row.items()
    )


def _distinct(
    points: Iterator[Row], generator: random.Random, sizes: Sequence[int], count: int
) -> set[Row]:
    """The first so many different combinations; from all others if points go on repeating."""
    found: set[Row] = set()
    for _, point in zip(range(20 * count), points, strict=False):
        found.add(point)
        if len(found) == count:
            return found
    others = [row for row in product(*map(range, sizes)) if row not in found]
    _shuffle(others, generator)
    return found | set(others[: count - len(found)])


def _random(generator: random.Random, sizes: Sequence[int], count: int) -> Iterator[Row]:
    del count
    while True:
        yield tuple(_below(generator, size) for size in sizes)


def _lhs(generator: random.Random, sizes: Sequence[int], count: int) -> Iterator[Row]:
    """Latin hypercubes: each value of each variation occurs equally often, as far as possible."""
    while True:
        columns = []
        for size in sizes:
            order = list(range(count))
            _shuffle(order, generator)
            columns.append([place * size // count for place in order])
        yield from zip(*columns, strict=True)


def _sobol(generator: random.Random, sizes: Sequence[int], count: int) -> Iterator[Row]:
    """Sobol's sequence, shifted at random by its digits."""
    del count
    directions = [_direction_numbers(axis) for axis in range(len(sizes))]
    state = [generator.getrandbits(_BITS) for _ in sizes]
    for number in range(1, 1 << _BITS):
        yield tuple(x * size >> _BITS for x, size in zip(state, sizes, strict=True))
        bit = (number & -number).bit_length() - 1
        state = [x ^ numbers[bit] for x, numbers in zip(state, directions, strict=True)]


def _direction_numbers(axis: int) -> list[int]:
    if axis == 0:
        return [1 << (_BITS - 1 - bit) for bit in range(_BITS)]
    polynomial, numbers = _DIRECTIONS[axis - 1]
    degree, values = len(numbers), list(numbers)
    for bit in range(degree, _BITS):
        value = values[bit - degree] ^ (values[bit - degree] << degree)
        for step in range(1, degree):
            if polynomial >> (degree - 1 - step) & 1:
                value ^= values[bit - step] << step
        values.append(value)
    return [value << (_BITS - 1 - bit) for bit, value in enumerate(values)]


def _below(generator: random.Random, limit: int) -> int:
    return generator.getrandbits(64) * limit >> 64


def _shuffle(items: list[_Item], generator: random.Random) -> None:
    for last in range(len(items) - 1, 0, -1):
        other = _below(generator, last + 1)
        items[last], items[other] = items[other], items[last]


_POINTS: dict[str, Callable[[random.Random, Sequence[int], int], Iterator[Row]]] = {
    "lhs": _lhs,
    "random": _random,
    "sobol": _sobol,
}
