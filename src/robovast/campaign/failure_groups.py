"""Failures by cause: reasons that differ only in numbers have one cause. Pure functions.

If a number has clearly separate groups, such as 0.1 s and 2 to 8 s, each group is a cause of its
own (`cause_numbers` has the rule). Otherwise the cause has the range of its numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Generic, TypeVar

from robovast.campaign.cause_numbers import (
    NUMBER,
    fewest,
    is_name,
    numbers_of,
    range_of,
    threshold,
    unit_of,
)
from robovast.campaign.reasons import plain
from robovast.campaign.verdict import Verdict

Run = TypeVar("Run")

NO_REASON = "no reason is known"

_CODE = r"(?<!code )(?<!status )(?<!failed with )(?<!errno )(?<!HTTP )"
"""Words before numbers that tell causes apart."""
_VARYING = re.compile(
    r"([0-9a-f]{8}-(?:[0-9a-f]{4}-){3}[0-9a-f]{12}|\b0x[0-9a-f]+\b"
    rf"|{_CODE}(?<!\d)(?<!\d\.){NUMBER}(?:[\s,;:/_x-]*{NUMBER})*)",
    re.IGNORECASE,
)
"""What differs between reasons of one cause: identifiers, and numbers in a row."""


@dataclass(frozen=True)
class FailureGroup(Generic[Run]):
    """Runs that did not pass for one cause."""

    cause: str
    """Their reason; `…` stands for the numbers in which they differ."""
    numbers: str
    """The ranges of these numbers; empty if there are none."""
    verdicts: tuple[Verdict, ...]
    """Their verdicts, which usually are one."""
    runs: tuple[Run, ...]
    """In the order in which they were given."""

    @property
    def text(self) -> str:
        """The cause with the ranges of its numbers, in one line."""
        return f"{self.cause} ({self.numbers})" if self.numbers else self.cause


def failure_groups(runs: Iterable[tuple[Run, Verdict, str]]) -> list[FailureGroup[Run]]:
    """Group the runs that did not pass, given with verdict and reason; the largest groups first."""
    bad = [(run, verdict, reason) for run, verdict, reason in runs if verdict != Verdict.PASSED]
    cause_of = causes(reason for _, _, reason in bad)
    members: dict[Cause, list[tuple[Run, Verdict]]] = {}
    for run, verdict, reason in bad:
        members.setdefault(cause_of[reason], []).append((run, verdict))
    groups = [
        FailureGroup(
            cause.label,
            cause.numbers,
            tuple(verdict for verdict in Verdict if verdict in {found for _, found in group}),
            tuple(run for run, _ in group),
        )
        for cause, group in members.items()
    ]
    return sorted(groups, key=lambda group: -len(group.runs))


@dataclass(frozen=True)
class Cause:
    """What reasons have in common."""

    label: str
    """Their text, with `…` or a range in place of each part that differs."""
    numbers: str
    """Ranges of the numbers that `…` stands for, with their units."""


def causes(reasons: Iterable[str]) -> dict[str, Cause]:
    """The cause of each reason; a reason is given as often as runs have it."""
    members: dict[str, list[_Reason]] = {}
    known: dict[str, _Reason] = {}
    for reason in reasons:
        one = known.get(reason) or known.setdefault(reason, (reason, _parts(reason)))
        members.setdefault(_key(one[1]), []).append(one)
    found: dict[str, Cause] = {}
    for group in members.values():
        for alike, numbers, split in _separate(group, fewest(len(group)), frozenset()):
            cause = _cause([parts for _, parts in alike], numbers, split)
            found.update((reason, cause) for reason, _ in alike)
    return found


_Reason = tuple[str, list[str]]
"""A reason and its parts."""
_Place = tuple[int, int]
"""A number of a reason: the place of its varying part, and its place in it."""
_Numbers = Mapping[_Place, Sequence[str]]
"""The texts of numbers, one for each reason."""


def _separate(
    reasons: Sequence[_Reason], least: int, split: frozenset[_Place]
) -> Iterator[tuple[Sequence[_Reason], _Numbers, frozenset[_Place]]]:
    """Divide the reasons of one text where a number has separate groups, as often as it has.

    Args:
        reasons: the reason of each run.
        least: fewest runs of a group.
        split: numbers that divide them from others.
    """
    numbers = _numbers([parts for _, parts in reasons])
    for place, texts in numbers.items():
        limit = threshold(texts, least)
        if limit is not None:
            for is_above in (False, True):
                pairs = zip(reasons, texts, strict=True)
                side = [reason for reason, text in pairs if (float(text) >= limit) is is_above]
                yield from _separate(side, least, split | {place})
            return
    yield reasons, numbers, split


def _numbers(parts: Sequence[list[str]]) -> _Numbers:
    """The texts of each number that differs between reasons, and is a measurement."""
    found: dict[_Place, Sequence[str]] = {}
    for place in range(1, len(parts[0]), 2):
        if is_name(parts[0][place - 1]):
            continue
        rows = [numbers_of(part[place]) for part in parts]
        if len({len(row) for row in rows}) == 1:
            for column, texts in enumerate(zip(*rows, strict=True)):
                if len(set(texts)) > 1:
                    found[place, column] = texts
    return found


def _cause(parts: Sequence[list[str]], texts: _Numbers, split: frozenset[_Place]) -> Cause:
    ranges = {place: range_of(own) for place, own in texts.items()}
    label, numbers = list(parts[0]), []
    for place in range(1, len(label), 2):
        if len({part[place] for part in parts}) == 1:
            continue
        own = {column: text for (part, column), text in ranges.items() if part == place}
        shown = [text for column, text in own.items() if (place, column) in split]
        hidden = [text for column, text in own.items() if (place, column) not in split]
        label[place] = ", ".join([*shown, "…"] if hidden or not own else shown)
        if hidden:
            numbers.append(", ".join(hidden) + unit_of(parts[0][place + 1]))
    return Cause("".join(label), "; ".join(numbers))


def cause_key(reason: str) -> str:
    """Equal for reasons of one cause."""
    return _key(_parts(reason))


def _key(parts: Sequence[str]) -> str:
    return "#".join(parts[::2])


@lru_cache(maxsize=4096)
def _parts(reason: str) -> list[str]:
    """A reason's constant and varying parts, in turns."""
    return _VARYING.split(plain(reason) or NO_REASON)
