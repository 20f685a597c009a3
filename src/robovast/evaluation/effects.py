"""Which factors explain the failures of a campaign: one split of the configurations for each.

A split compares configurations on one side of a value with all others. What chance explains is told
by permutation: failures are dealt to other configurations at random, and the best split of all
factors is searched again (Westfall and Young, 1993). So neither the number of factors and values
nor the likeness of the runs of one configuration makes chance look like a cause.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from math import isfinite, sqrt
from random import Random
from typing import Any

from robovast.base.serialization import spelled
from robovast.campaign.verdict import Verdict
from robovast.evaluation.summaries import VariantRuns

MOST_VALUES = 12
"""Texts with more different values are not split: each would name a few configurations."""
CUTS = 16
"""Most thresholds of a number."""
_SAMPLE = 1000
"""Most configurations that are permuted: clearness by chance does not depend on their number."""
_WORK = 5_000_000
"""Additions for all permutations; with many factors there are fewer of these."""
_PERMUTATIONS = (39, 399)
_Z = 1.959964
_SEED = 1


@dataclass(frozen=True, slots=True)
class Side:
    """The runs of the configurations on one side of a split."""

    condition: str
    """Such as `≤ 0.02`, `> 0.02`, `= depot` or `≠ depot`."""
    bad: int
    runs: int

    @property
    def rate(self) -> float:
        """Share of the runs that did not pass."""
        return self.bad / self.runs


@dataclass(frozen=True, slots=True)
class Effect:
    """How much more often the runs of some values of a factor fail."""

    factor: str
    worse: Side
    better: Side
    low: float
    """Lower limit of the 95 % interval of the difference of the rates. Configurations, not runs,
    count as independent."""
    high: float
    p: float
    """Probability that the best split of any factor would be as clear by chance."""
    same: tuple[str, ...]
    """Factors that divide the configurations in the same way."""
    clearness: float
    """The difference in units of its standard error if there were none."""


@dataclass(frozen=True, slots=True)
class _Counts:
    bad: int
    runs: int


@dataclass(frozen=True, slots=True)
class _Split:
    inside: str
    outside: str
    start: int
    """Where those inside begin in the column's order."""
    end: int


@dataclass(frozen=True, slots=True)
class _Column:
    """A factor: its configurations ordered by value, so that sums from the left give all splits."""

    order: Sequence[int]
    splits: Sequence[_Split]

    def members(self, split: _Split) -> Sequence[int]:
        """Configurations inside a split."""
        return self.order[split.start : split.end]

    def of(self, places: Mapping[int, int]) -> _Column:
        """The column of some configurations, which get these numbers."""
        kept = [0, *accumulate(n in places for n in self.order)]
        splits = [replace(s, start=kept[s.start], end=kept[s.end]) for s in self.splits]
        return _Column([places[n] for n in self.order if n in places], splits)


def effects(variants: Iterable[VariantRuns]) -> list[Effect]:
    """The best split of each factor that varies, the clearest first.

    Factors with structure are compared as JSON. A factor is left out if it has one value, or is a
    text with another value for nearly each configuration.

    Args:
        variants: of one campaign; those without a run that passed, failed or errored are left out.
    """
    seen = [(variant, own) for variant in variants if (own := _count(variant)).runs]
    counts = [own for _, own in seen]
    values = factor_columns([variant for variant, _ in seen])
    columns = {name: column for name, own in values.items() if (column := _column(own)).splits}
    total = _total(counts)
    if not columns or not 0 < total.bad < total.runs:
        return []
    chance = _clearest_by_chance(list(columns.values()), counts)
    found = [_effect(*best, counts, chance) for best in _without_equals(columns, counts)]
    return sorted(found, key=lambda effect: (effect.p, -effect.clearness))


def factor_columns(variants: Sequence[VariantRuns]) -> dict[str, list[Any]]:
    """The values of each factor, configuration by configuration."""
    rows = [variant.factors for variant in variants]
    names = dict.fromkeys(name for row in rows for name in row if not name.startswith("_"))
    return {name: [row.get(name) for row in rows] for name in names}


def _count(variant: VariantRuns) -> _Counts:
    verdicts = Counter(run.verdict for run in variant.runs)
    bad = verdicts[Verdict.FAILED] + verdicts[Verdict.ERRORED]
    return _Counts(bad, bad + verdicts[Verdict.PASSED])


def _total(counts: Iterable[_Counts]) -> _Counts:
    listed = list(counts)
    return _Counts(sum(one.bad for one in listed), sum(one.runs for one in listed))


def _column(values: Sequence[Any]) -> _Column:
    if all(map(is_number, values)):
        order = sorted(range(len(values)), key=values.__getitem__)
        return _Column(order, _number_splits([values[n] for n in order]))
    texts = [as_text(value) for value in values]
    different = Counter(texts)
    if not 1 < len(different) <= min(MOST_VALUES, len(values) - 1):
        return _Column((), ())
    place = {text: number for number, text in enumerate(different)}
    order = sorted(range(len(values)), key=lambda n: place[texts[n]])
    ends = accumulate(different.values())
    splits = [
        _Split(f"= {text}", f"≠ {text}", end - different[text], end)
        for text, end in zip(different, ends, strict=True)
    ]
    return _Column(order, splits[:1] if len(splits) == 2 else splits)


def as_text(value: Any) -> str:
    """A value of a factor as text, equal for equal values only: `1` and the text `"1"` differ."""
    return spelled(int(value) if is_number(value) and value == int(value) else value)


def is_number(value: Any) -> bool:
    """Whether a value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _number_splits(ordered: Sequence[float]) -> list[_Split]:
    different = sorted(set(ordered))[:-1]
    step = max(1, -(-len(different) // CUTS))
    return [
        _Split(f"≤ {cut:g}", f"> {cut:g}", 0, bisect_right(ordered, cut))
        for cut in different[step // 2 :: step]
    ]


def _without_equals(
    columns: Mapping[str, _Column], counts: Sequence[_Counts]
) -> Iterator[tuple[str, _Split, Sequence[int], float, tuple[str, ...]]]:
    """The clearest split of each factor with its members, and factors that divide equally."""
    everything = frozenset(range(len(counts)))
    groups: dict[frozenset[frozenset[int]], list[tuple[str, _Split, Sequence[int], float]]] = {}
    bad, runs, total = _sums(counts)
    for name, column in columns.items():
        scores = _scores(column, bad, runs, total)
        clear, split = max(zip(scores, column.splits, strict=True), key=lambda pair: pair[0])
        members = column.members(split)
        inside = frozenset(members)
        found = groups.setdefault(frozenset({inside, everything - inside}), [])
        found.append((name, split, members, clear))
    for (name, split, members, clear), *others in groups.values():
        yield name, split, members, clear, tuple(other for other, *_ in others)


def _sums(counts: Sequence[_Counts]) -> tuple[list[int], list[int], _Counts]:
    return [one.bad for one in counts], [one.runs for one in counts], _total(counts)


def _scores(
    column: _Column, bad: Sequence[int], runs: Sequence[int], total: _Counts
) -> Iterator[float]:
    """The clearness of each split."""
    bad_until = [0, *accumulate(map(bad.__getitem__, column.order))]
    runs_until = [0, *accumulate(map(runs.__getitem__, column.order))]
    for split in column.splits:
        start, end = split.start, split.end
        yield _score(bad_until[end] - bad_until[start], runs_until[end] - runs_until[start], total)


def _score(bad: int, runs: int, total: _Counts) -> float:
    """Difference of the rates in units of its standard error if there were none."""
    others = total.runs - runs
    if not runs or not others:
        return 0.0
    rate = total.bad / total.runs
    difference = bad / runs - (total.bad - bad) / others
    return abs(difference) / sqrt(rate * (1 - rate) * (1 / runs + 1 / others))


def _clearest_by_chance(columns: Sequence[_Column], counts: Sequence[_Counts]) -> list[float]:
    """The clearness of the best split of all, for permutations of the configurations."""
    random = Random(_SEED)  # noqa: S311
    chosen = sorted(random.sample(range(len(counts)), min(len(counts), _SAMPLE)))
    places = {n: place for place, n in enumerate(chosen)}
    columns = [column.of(places) for column in columns]
    bad, runs, total = _sums([counts[n] for n in chosen])
    if not 0 < total.bad < total.runs:
        return []
    fewest, most = _PERMUTATIONS
    rounds = max(fewest, min(most, _WORK // (len(columns) * len(chosen))))
    order = list(range(len(chosen)))
    found = []
    for _ in range(rounds):
        random.shuffle(order)
        own = [bad[n] for n in order], [runs[n] for n in order]
        found.append(max(max(_scores(column, *own, total)) for column in columns))
    return found


def _effect(
    name: str,
    split: _Split,
    members: Sequence[int],
    clear: float,
    same: tuple[str, ...],
    counts: Sequence[_Counts],
    chance: Sequence[float],
) -> Effect:
    within = set(members)
    inside = [counts[n] for n in members]
    outside = [one for n, one in enumerate(counts) if n not in within]
    sides = [_side(split.inside, inside), _side(split.outside, outside)]
    better, worse = sorted(sides, key=lambda side: side.rate)
    difference = worse.rate - better.rate
    half = _Z * sqrt(_variance(inside) + _variance(outside))
    return Effect(
        factor=name,
        worse=worse,
        better=better,
        low=max(-1.0, difference - half),
        high=min(1.0, difference + half),
        p=(1 + sum(one >= clear - 1e-9 for one in chance)) / (1 + len(chance)),
        same=same,
        clearness=clear,
    )


def _side(condition: str, counts: Sequence[_Counts]) -> Side:
    total = _total(counts)
    return Side(condition, total.bad, total.runs)


def _variance(counts: Sequence[_Counts]) -> float:
    """Variance of a rate: the larger of that between configurations and that of chance alone.

    The latter is smoothed (Agresti and Coull), since a few runs that all pass are not certain.
    """
    total = _total(counts)
    rate = total.bad / total.runs
    spread = sum((one.bad - rate * one.runs) ** 2 for one in counts)
    number = len(counts)
    between = spread / total.runs**2 * (number / (number - 1) if number > 1 else 1.0)
    smooth = (total.bad + 2) / (total.runs + 4)
    return max(between, smooth * (1 - smooth) / (total.runs + 4))
