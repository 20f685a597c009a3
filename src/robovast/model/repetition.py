"""Executing bad runs once more: which of them share a pod. Pure functions.

`finish` stores the ids of all bad runs in the bucket, under a name that their digest is part of.
The pods of a repetition read them there; the operator needs the sizes of the groups alone.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

from robovast.base.ranges import Span, clip, count, format_ranges, ids, merge, parse_ranges
from robovast.model.packs import PlanSpec

_GROUP = re.compile(r"([1-9]\d{0,8})x([1-9]\d{0,8})")


def retry_groups(plan: PlanSpec, runs: Iterable[Span]) -> list[list[int]]:
    """Run ids that are executed once more, in groups: each is a pod's share.

    Runs of one stretch fill groups of a pack's size. What is left of each stretch makes groups
    whose sizes are powers of two: so few sizes tell all groups, whatever the ids are. Larger groups
    come first.
    """
    stretches = groupby(ids(merge(runs)), plan.stretch_of)
    groups = [group for _, run_ids in stretches for group in _cut(list(run_ids), plan.runs_per_job)]
    return sorted(groups, key=len, reverse=True)


def _cut(run_ids: Sequence[int], size: int) -> Iterator[list[int]]:
    first = 0
    while first < len(run_ids):
        left = len(run_ids) - first
        step = size if left >= size else 1 << (left.bit_length() - 1)
        yield list(run_ids[first : first + step])
        first += step


@dataclass(frozen=True)
class GroupSizes:
    """The sizes of all groups of a repetition, in their order."""

    parts: tuple[tuple[int, int], ...]
    """Size of a group and how many of that size follow one another."""

    @classmethod
    def of(cls, groups: Iterable[Sequence[int]]) -> GroupSizes:
        """The sizes of groups."""
        sizes = groupby(len(group) for group in groups)
        return cls(tuple((size, sum(1 for _ in alike)) for size, alike in sizes))

    @classmethod
    def parse(cls, text: str) -> GroupSizes:
        """Sizes as `str` of them has it, `20x13,8x1,1x2`.

        Raises:
            ValueError: the text is none.
        """
        matches = [_GROUP.fullmatch(part) for part in text.split(",")] if text else []
        found = tuple((int(match[1]), int(match[2])) for match in matches if match)
        if len(found) != len(matches):
            raise ValueError(f"`{text}` is no list of sizes as `20x13,4x1`")
        return cls(found)

    def __str__(self) -> str:
        """`20x13,8x1,1x2`."""
        return ",".join(f"{size}x{number}" for size, number in self.parts)

    @cached_property
    def groups(self) -> int:
        """How many groups there are."""
        return sum(number for _, number in self.parts)

    @cached_property
    def runs(self) -> int:
        """How many runs there are in all groups."""
        return sum(size * number for size, number in self.parts)

    def runs_of(self, groups: Sequence[Span]) -> int:
        """How many runs there are in some groups."""
        total = first = 0
        for size, number in self.parts:
            total += size * count(clip(groups, first, first + number - 1))
            first += number
        return total


def list_name(text: str) -> str:
    """Name of a list of bad runs."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def list_key(name: str) -> str:
    """Key of a list of bad runs in the campaign's bucket."""
    return f"_transient/bad-runs-{name}.txt"


def list_text(runs: Iterable[Span]) -> str:
    """The content of a list of bad runs."""
    return format_ranges(merge(runs))


def parse_list(name: str, content: bytes) -> list[Span]:
    """The runs in a list.

    Raises:
        ValueError: it is not the list of that name.
    """
    text = content.decode()
    if list_name(text) != name:
        raise ValueError("it is not what was stored under that name")
    return parse_ranges(text)
