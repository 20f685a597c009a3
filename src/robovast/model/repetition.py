"""Repetition of bad runs: how they are grouped into pods. Pure functions.

`finish` stores the ids of all bad runs in the bucket; the object's name contains their digest.
The repetition's pods read them there; the operator only needs the group sizes.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

from robovast.base.ranges import Span, clip, count, format_ranges, ids, merge, parse_ranges
from robovast.model.naming import TRANSIENT
from robovast.model.packs import PlanSpec

_GROUP = re.compile(r"([1-9]\d{0,8})x([1-9]\d{0,8})")


def retry_groups(plan: PlanSpec, runs: Iterable[Span]) -> list[list[int]]:
    """Run ids to execute again, in groups; each pod executes one group.

    Runs of one stretch fill groups of a pack's size. The remainder of each stretch is split into
    groups whose sizes are powers of two, so that few sizes describe all groups. Larger groups come
    first.

    Runs of a variant that decide together how many of them are needed are one group, since each
    waits for those before it. Of 64 and more, the last few are others: sizes have six digits.
    """
    bad, size = ids(merge(runs)), plan.runs_per_pack
    together, digits = (plan.by_variants(bad), 6) if plan.by_variant else (plan.stretches(bad), 1)
    groups = [group for run_ids in together for group in _cut(run_ids, size, digits)]
    return sorted(groups, key=len, reverse=True)


def _cut(run_ids: Sequence[int], size: int, digits: int) -> Iterator[list[int]]:
    """Parts of at most a size; smaller ones have so many binary digits before zeros."""
    first = 0
    while first < len(run_ids):
        left = len(run_ids) - first
        zeros = max(0, left.bit_length() - digits)
        step = size if left >= size else left >> zeros << zeros
        yield list(run_ids[first : first + step])
        first += step


@dataclass(frozen=True)
class GroupSizes:
    """Sizes of all groups of a repetition, in order."""

    parts: tuple[tuple[int, int], ...]
    """Pairs of a group size and the number of consecutive groups of that size."""

    @classmethod
    def of(cls, groups: Iterable[Sequence[int]]) -> GroupSizes:
        """The sizes of groups."""
        sizes = groupby(len(group) for group in groups)
        return cls(tuple((size, sum(1 for _ in alike)) for size, alike in sizes))

    @classmethod
    def parse(cls, text: str) -> GroupSizes:
        """Parse the text that `str` produces, such as `20x13,8x1,1x2`.

        Raises:
            ValueError: the text is not a list of sizes.
        """
        matches = [_GROUP.fullmatch(part) for part in text.split(",")] if text else []
        found = tuple((int(match[1]), int(match[2])) for match in matches if match)
        if len(found) != len(matches):
            raise ValueError(f"`{text}` is not a list of sizes such as `20x13,4x1`")
        return cls(found)

    def __str__(self) -> str:
        """`20x13,8x1,1x2`."""
        return ",".join(f"{size}x{number}" for size, number in self.parts)

    @cached_property
    def groups(self) -> int:
        """Number of groups."""
        return sum(number for _, number in self.parts)

    @cached_property
    def runs(self) -> int:
        """Number of runs in all groups."""
        return sum(size * number for size, number in self.parts)

    def runs_of(self, groups: Sequence[Span]) -> int:
        """Number of runs in the given groups."""
        total = first = 0
        for size, number in self.parts:
            total += size * count(clip(groups, first, first + number - 1))
            first += number
        return total


def list_name(text: str) -> str:
    """Name of a list of bad runs, made from its content's digest."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def list_key(name: str) -> str:
    """Key of a list of bad runs in the campaign's bucket."""
    return f"{TRANSIENT}/bad-runs-{name}.txt"


def list_text(runs: Iterable[Span]) -> str:
    """Content of a list of bad runs."""
    return format_ranges(merge(runs))


def parse_list(name: str, content: bytes) -> list[Span]:
    """The runs of a stored list.

    Raises:
        ValueError: the content does not match the name.
    """
    text = content.decode()
    if list_name(text) != name:
        raise ValueError("it differs from the stored file of this name")
    return parse_ranges(text)
