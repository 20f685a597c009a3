"""Which parameters explain the failures of a campaign: one split of the configurations for each.

A split compares configurations on one side of a value with all others. What chance explains is told
by permutation: failures are dealt to other configurations at random, and the best split of all
parameters is searched again (Westfall and Young, 1993). So neither the number of parameters and
values nor the likeness of the runs of one configuration makes chance look like a cause.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from random import Random
from typing import Any

from robovast.campaign.verdict import Verdict
from robovast.evaluation.summaries import VariantRuns

MOST_VALUES = 12
"""Texts with more different values are not split: each would name a few configurations."""
CUTS = 16
"""Most thresholds of a number."""
_SAMPLE = 1000
"""Most configurations that are permuted: clearness by chance does not depend on their number."""
_WORK = 3_000_000
"""Additions for all permutations; with many splits there are fewer of these."""
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
    """How much more often the runs of some values of a parameter fail."""

    parameter: str
    worse: Side
    better: Side
    low: float
    """Lower limit of the 95 % interval of the difference of the rates. Configurations, not runs,
    count as independent."""
    high: float
    p: float
    """Probability that the best split of any parameter would be as clear by chance."""
    same: tuple[str, ...]
    """Parameters that divide the configurations in the same way."""


@dataclass(frozen=True, slots=True)
class _Counts:
    bad: int
    runs: int


@dataclass(frozen=True, slots=True)
class _Split:
    inside: str
    outside: str
    members: tuple[int, ...]
    """Configurations inside, ascending."""


def effects(variants: Iterable[VariantRuns]) -> list[Effect]:
    """The best split of each parameter that varies, the clearest first.

    Parameters with structure are compared as JSON. A parameter is left out if it has one value, or
    is a text with another value for nearly each configuration.

    Args:
        variants: of one campaign; those without a run that passed, failed or errored are left out.
    """
    seen = [(variant, own) for variant in variants if (own := _count(variant)).runs]
    counts = [own for _, own in seen]
    columns = _columns([variant.factors for variant, _ in seen])
    splits = {name: cuts for name, values in columns.items() if (cuts := _splits(values))}
    total = _total(counts)
    if not splits or not 0 < total.bad < total.runs:
        return []
    best = _without_equals(splits, counts)
    chance = _clearest_by_chance(list(splits.values()), counts)
    found = [_effect(name, split, same, counts, chance) for name, split, same in best]
    return sorted(found, key=lambda effect: (effect.p, -(effect.worse.rate - effect.better.rate)))


def _count(variant: VariantRuns) -> _Counts:
    verdicts = Counter(run.verdict for run in variant.runs)
    bad = verdicts[Verdict.FAILED] + verdicts[Verdict.ERRORED]
    return _Counts(bad, bad + verdicts[Verdict.PASSED])


def _total(counts: Iterable[_Counts]) -> _Counts:
    listed = list(counts)
    return _Counts(sum(one.bad for one in listed), sum(one.runs for one in listed))


def _columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """The values of each parameter, configuration by configuration."""
    names = dict.fromkeys(name for row in rows for name in row if not name.startswith("_"))
    return {name: [row.get(name) for row in rows] for name in names}


def _splits(values: Sequence[Any]) -> list[_Split]:
    """All splits of one parameter."""
    if all(map(_is_number, values)):
        return _number_splits(values)
    texts = [
        value if isinstance(value, str) else json.dumps(value, default=str) for value in values
    ]
    different = Counter(texts)
    if not 1 < len(different) <= min(MOST_VALUES, len(values) - 1):
        return []
    shown = list(different)[:1] if len(different) == 2 else different
    return [
        _Split(f"= {text}", f"≠ {text}", tuple(n for n, own in enumerate(texts) if own == text))
        for text in shown
    ]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _number_splits(values: Sequence[float]) -> list[_Split]:
    different = sorted(set(values))[:-1]
    step = max(1, -(-len(different) // CUTS))
    return [
        _Split(f"≤ {cut:g}", f"> {cut:g}", tuple(n for n, own in enumerate(values) if own <= cut))
        for cut in different[step // 2 :: step]
    ]


def _without_equals(
    splits: Mapping[str, Sequence[_Split]], counts: Sequence[_Counts]
) -> Iterator[tuple[str, _Split, tuple[str, ...]]]:
    """The clearest split of each parameter, with the parameters that divide equally."""
    everything = frozenset(range(len(counts)))
    groups: dict[frozenset[frozenset[int]], list[tuple[str, _Split]]] = {}
    for name, own in splits.items():
        split = max(own, key=lambda one: _clearness(_total(counts[n] for n in one.members), counts))
        inside = frozenset(split.members)
        groups.setdefault(frozenset({inside, everything - inside}), []).append((name, split))
    for (name, split), *others in groups.values():
        yield name, split, tuple(other for other, _ in others)


def _clearness(inside: _Counts, counts: Sequence[_Counts]) -> float:
    """Difference of the rates in units of its standard error if there were none."""
    return _score(inside.bad, inside.runs, _total(counts))


def _score(bad: int, runs: int, total: _Counts) -> float:
    others = total.runs - runs
    if not runs or not others:
        return 0.0
    rate = total.bad / total.runs
    difference = bad / runs - (total.bad - bad) / others
    return abs(difference) / sqrt(rate * (1 - rate) * (1 / runs + 1 / others))


def _clearest_by_chance(
    splits: Sequence[Sequence[_Split]], counts: Sequence[_Counts]
) -> list[float]:
    """The clearness of the best split of all, for permutations of the configurations."""
    random = Random(_SEED)  # noqa: S311
    chosen = sorted(random.sample(range(len(counts)), min(len(counts), _SAMPLE)))
    places = {n: place for place, n in enumerate(chosen)}
    members = [[places[n] for n in split.members if n in places] for own in splits for split in own]
    bad, runs = [counts[n].bad for n in chosen], [counts[n].runs for n in chosen]
    total = _Counts(sum(bad), sum(runs))
    if not 0 < total.bad < total.runs:
        return []
    fewest, most = _PERMUTATIONS
    rounds = max(fewest, min(most, _WORK // (2 * sum(map(len, members)))))
    order = list(range(len(chosen)))
    found = []
    for _ in range(rounds):
        random.shuffle(order)
        own_bad, own_runs = [bad[n] for n in order], [runs[n] for n in order]
        sums = (
            (sum(map(own_bad.__getitem__, one)), sum(map(own_runs.__getitem__, one)))
            for one in members
        )
        found.append(max(_score(*inside, total) for inside in sums))
    return found


def _effect(
    name: str,
    split: _Split,
    same: tuple[str, ...],
    counts: Sequence[_Counts],
    chance: Sequence[float],
) -> Effect:
    members = set(split.members)
    inside = [counts[n] for n in split.members]
    outside = [one for n, one in enumerate(counts) if n not in members]
    sides = [_side(split.inside, inside), _side(split.outside, outside)]
    better, worse = sorted(sides, key=lambda side: side.rate)
    difference = worse.rate - better.rate
    half = _Z * sqrt(_variance(inside) + _variance(outside))
    clear = _clearness(_total(inside), counts)
    return Effect(
        parameter=name,
        worse=worse,
        better=better,
        low=max(-1.0, difference - half),
        high=min(1.0, difference + half),
        p=(1 + sum(one >= clear - 1e-9 for one in chance)) / (1 + len(chance)),
        same=same,
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
