"""The numbers in the reasons of one cause: their ranges, and groups that are clearly separate.

The rule for separate groups: sort one number of all runs, and look at the widest gap between
neighbors. The runs below and above it are separate groups if

- each has at least `LEAST_RUNS` runs and `LEAST_SHARE` of all runs,
- the gap is at least `WIDER` times as wide as each other gap, and
- it is large: the number above it is at least `FACTOR` times the one below it. Numbers of which
  some are negative, such as coordinates, differ by at least half of the largest of them instead.

Gaps of numbers that are never negative are ratios: 0.1 s and 1 s are as far apart as 1 s and 10 s.
A number that is smaller than its last digit counts as one such digit. Pure functions.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from math import ceil, isfinite, log

LEAST_RUNS = 3
LEAST_SHARE = 0.05
WIDER = 3
FACTOR = 2

NUMBER = r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
_PLAIN = re.compile(rf"{NUMBER}(?:[\s,;:]+{NUMBER})*")
_NUMBERS = re.compile(NUMBER)
_INSIDE_NAME = re.compile(r"[\w/.-]$")
_UNIT = re.compile(r"\s?(?:[num]?s|min|h|[cmk]?m(?:/s)?|m/s²|rad(?:/s)?|°|deg|%|[kMG]?Hz)(?!\w)")


def is_name(before: str) -> bool:
    """Whether a varying part belongs to a name, by the constant part before it."""
    return _INSIDE_NAME.search(before) is not None


def numbers_of(text: str) -> list[str]:
    """The numbers of a varying part of a reason; none of an identifier."""
    if not _PLAIN.fullmatch(text):
        return []
    found = _NUMBERS.findall(text)
    return found if isfinite(sum(map(float, found))) else []


def unit_of(after: str) -> str:
    """The unit that begins the text after a number, with the space before it, or nothing."""
    found = _UNIT.match(after)
    return found[0] if found else ""


def range_of(texts: Sequence[str]) -> str:
    """The least and the greatest of numbers, as they are written."""
    low, high = min(texts, key=float), max(texts, key=float)
    return low if float(low) == float(high) else f"{low} – {high}"


def threshold(texts: Sequence[str], least: int = LEAST_RUNS) -> float | None:
    """The smallest number of the upper group, if there are two clearly separate groups.

    Args:
        texts: one number of each run.
        least: fewest runs of a group.
    """
    values = sorted(map(float, texts))
    places = _places(values, 10.0 ** -max(map(_decimals, texts)))
    gaps = [above - below for below, above in pairwise(places)]
    if not gaps:
        return None
    widest = max(range(len(gaps)), key=gaps.__getitem__)
    rest = max((*gaps[:widest], *gaps[widest + 1 :]), default=0.0)
    large = log(FACTOR) if values[0] >= 0 else max(map(abs, values)) / 2
    is_clear = (
        gaps[widest] >= max(large, WIDER * rest) and least <= widest + 1 <= len(values) - least
    )
    return values[widest + 1] if is_clear else None


def fewest(runs: int) -> int:
    """Fewest runs of a separate group among so many of a cause."""
    return max(LEAST_RUNS, ceil(LEAST_SHARE * runs))


def _places(values: Sequence[float], digit: float) -> list[float]:
    """Where numbers are on the scale on which their gaps are compared."""
    return list(values) if values[0] < 0 else [log(max(value, digit)) for value in values]


def _decimals(text: str) -> int:
    return len(text.partition(".")[2].partition("e")[0].partition("E")[0])
