"""Which combinations of the values of variations a campaign has run, and which of them failed."""

from __future__ import annotations

import math
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from robovast.base.errors import InputError
from robovast.base.statistics import Interval, wilson
from robovast.campaign.verdict import Verdict
from robovast.evaluation.summaries import VariantRuns
from robovast.model.designs import (
    MOST_PAIRS,
    Row,
    coverages,
    missing_pairs,
    pairs_in,
    pairs_of,
)
from robovast.model.document import Document
from robovast.model.document.model import ConfigurationEntry
from robovast.model.document.section import PluginCall
from robovast.model.naming import is_run_number
from robovast.model.variations.loader import levels

_LARGEST = sys.float_info.max / 2
"""Largest number whose distance from any other one is finite."""


@dataclass(frozen=True)
class VariationAxis:
    """The values of a variation."""

    labels: tuple[str, ...]
    drawn: str = ""
    """The parameter whose drawn values were divided into buckets; empty if values are listed."""
    edges: tuple[float, float] = (0.0, 0.0)
    """Smallest and largest drawn value."""

    def position(self, number: int, parameters: Mapping[str, Any]) -> int:
        """Position of a variant's value, by its number in the variant's name or its bucket."""
        if not self.drawn:
            return number - 1
        low, high = self.edges
        share = (float(parameters[self.drawn]) - low) / ((high - low) or 1.0)
        return min(int(share * len(self.labels)), len(self.labels) - 1)


@dataclass(frozen=True)
class Pair:
    """Two values of different variations that were run together."""

    values: str
    runs: int
    bad: int

    @property
    def interval(self) -> Interval:
        """95 % interval of the share of bad runs."""
        return wilson(self.bad, self.runs)


@dataclass(frozen=True)
class EntryCoverage:
    """What was run of one entry."""

    entry: ConfigurationEntry
    axes: Sequence[VariationAxis]
    counts: Mapping[Row, tuple[int, int]] = field(default_factory=dict)
    """Runs with a verdict, and how many of them did not pass, by combination."""

    @property
    def sizes(self) -> list[int]:
        """Number of values of each variation."""
        return [len(axis.labels) for axis in self.axes]

    @property
    def product(self) -> int:
        """Number of combinations that there are."""
        return math.prod(self.sizes)

    def covered(self) -> dict[str, tuple[int, int]]:
        """How many values, pairs and triples were run, and how many there are."""
        return coverages(list(self.counts), self.sizes)

    def bad_pairs(self) -> list[Pair]:
        """Pairs of which runs did not pass, the worst first."""
        sums: dict[str, list[int]] = defaultdict(lambda: [0, 0])
        for row, (runs, bad) in self.counts.items():
            for axes, values in pairs_in(row):
                sums[self._label(axes, values)][0] += runs
                sums[self._label(axes, values)][1] += bad
        found = (Pair(values, *counted) for values, counted in sums.items() if counted[1])
        return sorted(found, key=lambda pair: (-pair.interval[0], pair.values))

    def holes(self) -> list[str]:
        """Pairs that were never run."""
        left = missing_pairs(self.counts, self.sizes)
        return [self._label(axes, pair) for axes, found in left.items() for pair in sorted(found)]

    def _label(self, axes: tuple[int, int], values: tuple[int, int]) -> str:
        chosen = zip(axes, values, strict=True)
        return ", ".join(self.axes[axis].labels[value] for axis, value in chosen)


def campaign_coverage(
    document: Document, variants: Sequence[VariantRuns], buckets: int | None
) -> list[EntryCoverage]:
    """The coverage of each entry with variations.

    Args:
        document: the campaign's.
        variants: with their stored runs.
        buckets: number of equal parts into which drawn values are divided.

    Raises:
        InputError: values are drawn, and there are no buckets; no entry has variations; there are
            too many pairs.
    """
    entries = [entry for entry in document.vast.configuration or () if entry.variations]
    if not entries:
        raise InputError(
            f"{document.path}: no configuration has variations.",
            hint="add `variations` to a configuration",
        )
    return [_entry_coverage(document, entry, variants, buckets) for entry in entries]


def _entry_coverage(
    document: Document,
    entry: ConfigurationEntry,
    variants: Sequence[VariantRuns],
    buckets: int | None,
) -> EntryCoverage:
    own = list(_numbered(entry, variants))
    calls = range(len(entry.variations or ()))
    axes = [_axis(_Varied(document, entry, place), own, buckets) for place in calls]
    found = EntryCoverage(entry, axes)
    if pairs_of(found.sizes) > MOST_PAIRS:
        raise InputError(
            f"{document.path}: `{entry.name}` has {pairs_of(found.sizes):,} pairs of values. The "
            f"maximum is {MOST_PAIRS:,}.",
            hint="use fewer variations or values",
        )
    counts: dict[Row, tuple[int, int]] = {}
    for numbers, variant in own:
        places = zip(axes, numbers, strict=True)
        row = tuple(axis.position(number, variant.parameters) for axis, number in places)
        if all(0 <= value < size for value, size in zip(row, found.sizes, strict=True)):
            runs = [run for run in variant.runs if run.verdict is not Verdict.INTERRUPTED]
            bad = sum(run.verdict is not Verdict.PASSED for run in runs)
            before = counts.get(row, (0, 0))
            if runs:
                counts[row] = (before[0] + len(runs), before[1] + bad)
    return EntryCoverage(entry, axes, counts)


def _numbered(
    entry: ConfigurationEntry, variants: Sequence[VariantRuns]
) -> Iterator[tuple[list[int], VariantRuns]]:
    """The variants of an entry, with the numbers in their names: one for each variation."""
    for variant in variants:
        head, _, tail = variant.name.partition(f"{entry.name}-")
        numbers = tail.split("-")
        is_own = variant.entry in {entry.name, variant.name}  # its own name: no record says which
        is_named = not head and len(numbers) == len(entry.variations or ())
        if is_own and is_named and all(map(is_run_number, numbers)):
            yield list(map(int, numbers)), variant


@dataclass(frozen=True, slots=True)
class _Varied:
    """One variation of an entry."""

    document: Document
    entry: ConfigurationEntry
    position: int

    @property
    def call(self) -> PluginCall:
        return (self.entry.variations or ())[self.position]

    def problem(self, message: str) -> str:
        """A message about it, with its place in the file."""
        index = (self.document.vast.configuration or []).index(self.entry)
        place = ("configuration", index, "variations", self.position)
        return str(self.document.source.problem(place, message))


def _axis(
    varied: _Varied, own: Sequence[tuple[list[int], VariantRuns]], buckets: int | None
) -> VariationAxis:
    call = varied.call
    size = levels(call.name, call.parameters, varied.document.folder)
    if size is None:
        return _drawn(varied, own, buckets)
    name, values = call.parameters.get("name"), call.parameters.get("values")
    if call.name != "ParameterVariationList" or not isinstance(values, list):
        return VariationAxis(tuple(f"{call.name} {number}" for number in range(1, size + 1)))
    names = ", ".join(name) if isinstance(name, list) else str(name)
    return VariationAxis(tuple(f"{names}={value}" for value in values))


def _drawn(
    varied: _Varied, own: Sequence[tuple[list[int], VariantRuns]], buckets: int | None
) -> VariationAxis:
    name = varied.call.parameters.get("name")
    if buckets is None or not isinstance(name, str):
        what = f"`{varied.call.name}` has random continuous values"
        hint = "group them into intervals, for example with `--buckets 5`"
        raise InputError(varied.problem(what), hint=hint)
    found = [variant.parameters.get(name) for _, variant in own]
    numbers = [
        float(value) for value in found if isinstance(value, int | float) and abs(value) <= _LARGEST
    ]
    if len(numbers) < len(found) or not numbers:
        raise InputError(
            f"`{name}` of `{varied.entry.name}` must be a finite number in all configurations."
        )
    low, high = min(numbers), max(numbers)
    step = (high - low) / buckets
    labels = (f"{name} {low + n * step:.4g} – {low + (n + 1) * step:.4g}" for n in range(buckets))
    return VariationAxis(tuple(labels), name, (low, high))
