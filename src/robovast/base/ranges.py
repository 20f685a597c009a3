"""Sets of run ids as text: `17,204-206`."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence

Span = tuple[int, int]
"""First and last id, both inclusive."""

_ITEM = re.compile(r"(\d+)(?:-(\d+))?")


def spans(ids: Iterable[int]) -> list[Span]:
    """Convert ids, in any order and with duplicates, to sorted separate spans."""
    return merge((id_, id_) for id_ in ids)


def merge(parts: Iterable[Span]) -> list[Span]:
    """Convert spans, in any order and overlapping, to sorted separate spans."""
    merged: list[Span] = []
    for first, last in sorted(parts):
        if merged and first <= merged[-1][1] + 1:
            merged[-1] = (merged[-1][0], max(merged[-1][1], last))
        else:
            merged.append((first, last))
    return merged


def subtract(parts: Iterable[Span], minus: Iterable[Span]) -> list[Span]:
    """Ids in `parts` that are not in `minus`."""
    left: list[Span] = []
    cuts = merge(minus)
    at = 0
    for begin, last in merge(parts):
        first = begin
        while at < len(cuts) and cuts[at][0] <= last:
            cut_first, cut_last = cuts[at]
            if cut_first > first:
                left.append((first, cut_first - 1))
            first = max(first, cut_last + 1)
            if cut_last > last:
                break  # it may reach into the next part
            at += 1
        if first <= last:
            left.append((first, last))
    return left


def clip(parts: Iterable[Span], first: int, last: int) -> list[Span]:
    """Ids between two ids, both inclusive."""
    return [(max(a, first), min(b, last)) for a, b in parts if a <= last and b >= first]


def shift(parts: Iterable[Span], by: int) -> list[Span]:
    """Every id increased by `by`."""
    return [(first + by, last + by) for first, last in parts]


def contains(parts: Sequence[Span], id_: int) -> bool:
    """Whether sorted separate spans contain an id."""
    at = bisect_right(parts, id_, key=lambda span: span[0]) - 1
    return at >= 0 and id_ <= parts[at][1]


def count(parts: Iterable[Span]) -> int:
    """Number of ids."""
    return sum(last - first + 1 for first, last in parts)


def ids(parts: Iterable[Span]) -> Iterator[int]:
    """All ids, in the order of the spans."""
    for first, last in parts:
        yield from range(first, last + 1)


def format_ranges(parts: Iterable[Span]) -> str:
    """Spans as text; empty without spans."""
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in parts)


def parse_ranges(text: str) -> list[Span]:
    """Parse text made by `format_ranges`, or the completed indexes of a Job.

    Raises:
        ValueError: the text is not a list of ranges.
    """
    return [_span(item) for item in text.split(",")] if text.strip() else []


def _span(item: str) -> Span:
    match = _ITEM.fullmatch(item.strip())
    if match is None:
        raise ValueError(f"`{item}` is not a valid range of numbers, such as `3` or `5-9`")
    first = int(match[1])
    last = int(match[2] or first)
    if last < first:
        raise ValueError(f"the range `{item}` ends before it begins")
    return first, last


def truncate(text: str, limit: int) -> tuple[str, bool]:
    """Shorten ranges to whole items of at most `limit` characters; True if shortened."""
    if len(text) <= limit:
        return text, False
    return text[: text.rfind(",", 0, limit + 1)] if "," in text[: limit + 1] else "", True
