"""Compares two campaigns: what got worse, and whether chance explains it."""

from __future__ import annotations

import json
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from typing import Literal

from robovast.base.statistics import (
    LEVEL,
    Interval,
    fisher_exact,
    holm,
    least,
    mcnemar_exact,
    newcombe,
    paired_interval,
    percent,
)
from robovast.campaign.verdict import Verdict
from robovast.evaluation.rates import MOST_RUNS, Sample, sample_of
from robovast.evaluation.summaries import RunSummary, VariantRuns

Change = Literal["worse", "better", "unclear", "same"]
MARGIN = 0.05
"""Difference of rates that does not matter, unless users say otherwise."""


@dataclass(frozen=True, slots=True)
class Difference:
    """Two samples, and the probability of such a difference by chance."""

    a: Sample
    b: Sample
    p: float
    """Two-sided p-value."""
    low: float
    """Lower limit of the 95 % interval of the difference of rates, b - a."""
    high: float
    pairs: tuple[int, int] | None = None
    """If the samples are of runs with equal seeds: how many of them got worse, and better."""


@dataclass(frozen=True, slots=True)
class VariantDifference:
    """One variant in both campaigns."""

    name_a: str
    name_b: str
    difference: Difference
    adjusted_p: float
    """Holm's correction for the number of variants."""
    change: Change
    """`worse` or `better` if the adjusted p-value is below `LEVEL`; `same` if the rates are equal,
    or surely differ by less than the margin; otherwise `unclear`."""
    more_runs: int | None
    """If `unclear`: how many further runs in each campaign decide it if they go like those before;
    None if `MOST_RUNS` do not."""


@dataclass(frozen=True)
class Comparison:
    """Two campaigns, matched variant by variant."""

    overall: Difference
    """All matched variants together."""
    change: Change
    """Of all together: `worse` or `better` if chance hardly explains it; `same` if the rate surely
    rose by less than the margin; otherwise `unclear`."""
    more_runs: int | None
    """If `change` is `unclear`: see `VariantDifference`; in all variants together."""
    margin: float
    least_p: float
    """The smallest p-value that a variant with so many runs can have: all failed, none before."""
    visible: int
    """Variants with enough runs to show such a change if all change like that, with Holm's
    correction."""
    needed_runs: int | None
    """Runs of each variant in each campaign that show such a change of any variant by the test
    that applies to it, even if no other variant changes; None if `MOST_RUNS` do not."""
    detectable: float | None
    """The smallest rise of the overall rate that these runs show beyond chance, by the test that
    applies to them."""
    statement: str
    variants: list[VariantDifference]
    """Sorted by p-value, the smallest first."""
    only_a: list[str]
    only_b: list[str]

    @property
    def result(self) -> str:
        """`worse` if all together or any variant got worse, otherwise `change`."""
        worse = any(variant.change == "worse" for variant in self.variants)
        return "worse" if worse else self.change


def compare(
    a: Iterable[VariantRuns], b: Iterable[VariantRuns], margin: float = MARGIN
) -> Comparison:
    """Compare campaign b with campaign a by variants with equal parameters."""
    left, right = _by_identity(a), _by_identity(b)
    pairs = [(left[key], right[key]) for key in left if key in right]
    matched = [_matched(one, other) for one, other in pairs]
    differences = [difference([runs]) for runs in matched]
    ps = [found.p for found in differences]
    adjusted = holm(ps)
    correct = partial(_corrected, sorted(ps), sorted(adjusted))
    variants = [
        _variant_difference((one.name, other.name), found, p, margin, correct)
        for (one, other), found, p in zip(pairs, differences, adjusted, strict=True)
    ]
    overall = difference(matched)
    change = _overall_change(overall, overall.p, overall.high, margin)

    def decide(more: int) -> bool:
        p, (_, high) = _projected(overall, more)
        return _overall_change(overall, p, high, margin) != "unclear"

    least_ps = [_least_p(one.pairs is not None, one.a.runs, one.b.runs) for one in differences]
    tests = {one.pairs is not None for one in differences}

    def shows_any(runs: int) -> bool:
        return all(_least_p(paired, runs, runs) * len(pairs) < LEVEL for paired in tests)

    return Comparison(
        overall=overall,
        change=change,
        more_runs=_more_runs(overall, decide) if change == "unclear" else None,
        margin=margin,
        least_p=min(least_ps, default=1.0),
        visible=sum(p < LEVEL for p in holm(least_ps)),
        needed_runs=least(shows_any, MOST_RUNS),
        detectable=_detectable(overall),
        statement=state(overall),
        variants=sorted(variants, key=lambda variant: variant.difference.p),
        only_a=[variant.name for key, variant in left.items() if key not in right],
        only_b=[variant.name for key, variant in right.items() if key not in left],
    )


@dataclass(frozen=True, slots=True)
class _Matched:
    """Runs of one variant in both campaigns, without interrupted ones."""

    a: Sequence[RunSummary]
    b: Sequence[RunSummary]
    paired: bool
    """Whether the n-th run of each has the seed of the other's."""
    same: bool = False
    """Whether both are the same runs: the campaigns are one, or one reused the other's runs."""


def _matched(one: VariantRuns, other: VariantRuns) -> _Matched:
    """Runs to compare: pairs of equal seeds if all runs of either campaign have such a partner."""
    a, b = (
        [run for run in variant.runs if run.verdict is not Verdict.INTERRUPTED]
        for variant in (one, other)
    )
    same = one is other or (len(a) == len(b) and all(map(_is_same_run, a, b)))
    seeds_a, seeds_b = ({run.seed: run for run in runs if run.seed is not None} for runs in (a, b))
    common = [seed for seed in seeds_a if seed in seeds_b]
    if common and len(common) == min(len(a), len(b)):
        return _Matched([seeds_a[s] for s in common], [seeds_b[s] for s in common], True, same)
    return _Matched(a, b, False, same)


def _is_same_run(a: RunSummary, b: RunSummary) -> bool:
    """Whether two records are of one run: no other run has its start, duration and verdict."""
    known, other = ((run.started_at, run.duration, run.verdict) for run in (a, b))
    return a.started_at is not None and known == other


def difference(matched: Sequence[_Matched]) -> Difference:
    """Test whether the rates of two campaigns differ in these variants together."""
    matched = _of_equal_shares(matched)
    a = [run for runs in matched for run in runs.a]
    b = [run for runs in matched for run in runs.b]
    one, other = sample_of(a), sample_of(b)
    paired = bool(matched) and all(runs.paired for runs in matched)
    if a and all(runs.same for runs in matched):
        return Difference(one, other, 1.0, 0.0, 0.0, (0, 0) if paired else None)
    if not paired:
        p = fisher_exact(one.bad, one.runs - one.bad, other.bad, other.runs - other.bad)
        return Difference(one, other, p, *newcombe(one.bad, one.runs, other.bad, other.runs))
    changed = [
        (x.verdict is Verdict.PASSED, y.verdict is Verdict.PASSED)
        for x, y in zip(a, b, strict=True)
    ]
    worse, better = changed.count((True, False)), changed.count((False, True))
    interval = paired_interval(worse, better, len(changed))
    return Difference(one, other, mcnemar_exact(worse, better), *interval, (worse, better))


def _of_equal_shares(matched: Sequence[_Matched]) -> Sequence[_Matched]:
    """The runs of several variants that may be put together.

    If a campaign has more runs of one variant and fewer of another than the other campaign, its
    rate differs even if nothing has changed. Then both give equally many runs of each variant.
    """
    filled = [runs for runs in matched if runs.a and runs.b]
    shares = {Fraction(len(runs.a), len(runs.b)) for runs in filled}
    if len(shares) <= 1:
        return filled if len(matched) > 1 else matched
    least_of = [(runs, min(len(runs.a), len(runs.b))) for runs in filled]
    return [_Matched(runs.a[:n], runs.b[:n], runs.paired, runs.same) for runs, n in least_of]


def state(found: Difference) -> str:
    """Describe a difference in words."""
    a, b = found.a, found.b
    if not a.runs or not b.runs:
        return "The campaigns cannot be compared, because no configuration has runs in both."
    if found.low == found.high:
        return f"No difference: both have the same {b.runs} runs, {b.bad} of them unsuccessful."
    verb = "rose" if b.rate > a.rate else "fell"
    certain = "chance alone hardly explains it" if found.p < LEVEL else "chance can explain it"
    before, now = (f"{percent(side.rate)} ({side.bad} of {side.runs})" for side in (a, b))
    text = f"The rate of unsuccessful runs {verb} from {before} to {now}, and {certain}"
    if a.rate == b.rate:
        text = f"No difference: {before} and {now} of the runs were unsuccessful"
    interval = f"95 % interval {100 * found.low:+.1f} to {100 * found.high:+.1f} percentage points"
    p = f"p = {found.p:.2g}" if found.p >= 0.0001 else "p < 0.0001"
    test = "Fisher's exact test" if found.pairs is None else "McNemar's exact test, equal seeds"
    return f"{text} ({test}, {p}; {interval})."


def _variant_difference(
    names: tuple[str, str],
    found: Difference,
    p: float,
    margin: float,
    correct: Callable[[float, float], float],
) -> VariantDifference:
    change = _variant_change(found, p, (found.low, found.high), margin)

    def decide(more: int) -> bool:
        p, interval = _projected(found, more)
        return _variant_change(found, correct(found.p, p), interval, margin) != "unclear"

    return VariantDifference(
        *names,
        difference=found,
        adjusted_p=p,
        change=change,
        more_runs=_more_runs(found, decide) if change == "unclear" else None,
    )


def _corrected(ps: Sequence[float], adjusted: Sequence[float], old: float, new: float) -> float:
    """Holm's correction of a p-value that replaces another one and is not larger.

    Args:
        ps: all p-values, sorted.
        adjusted: with Holm's correction, sorted.
        old: one of `ps`.
        new: takes its place.
    """
    rank = bisect_left(ps, min(old, new))
    return min(1.0, max(new * (len(ps) - rank), adjusted[rank - 1] if rank else 0.0))


def _variant_change(found: Difference, p: float, interval: Interval, margin: float) -> Change:
    if not found.a.runs or not found.b.runs:
        return "unclear"
    low, high = interval
    if found.a.rate == found.b.rate or (-margin < low and high < margin):
        return "same"
    if p >= LEVEL:
        return "unclear"
    return "worse" if found.b.rate > found.a.rate else "better"


def _overall_change(found: Difference, p: float, high: float, margin: float) -> Change:
    if p < LEVEL and found.b.rate < found.a.rate:
        return "better"
    if high <= margin:
        return "same"
    return "worse" if p < LEVEL else "unclear"


@cache
def _least_p(paired: bool, a: int, b: int) -> float:
    """The least p-value of so many runs: all failed after none had failed."""
    if paired:
        return mcnemar_exact(a, 0)
    return fisher_exact(0, a, b, 0) if a and b else 1.0


def _detectable(found: Difference) -> float | None:
    a, b = found.a, found.b
    if not a.runs or not b.runs:
        return None
    if found.pairs is not None:
        chance = min(found.pairs)  # so many pairs change in either direction by chance
        most = a.runs - a.bad - chance  # only what had passed can get worse
        worse = least(lambda rise: mcnemar_exact(chance + rise, chance) < LEVEL, most)
        return None if worse is None else worse / a.runs

    def is_clear(bad: int) -> bool:
        return bad / b.runs > a.rate and _fisher(a.bad, a.runs, bad, b.runs) < LEVEL

    bad = least(is_clear, b.runs)
    return None if bad is None else bad / b.runs - a.rate


@cache
def _fisher(bad_a: int, runs_a: int, bad_b: int, runs_b: int) -> float:
    return fisher_exact(bad_a, runs_a - bad_a, bad_b, runs_b - bad_b)


def _more_runs(found: Difference, decide: Callable[[int], bool]) -> int | None:
    return least(decide, MOST_RUNS) if found.a.runs and found.b.runs else None


def _projected(found: Difference, more: int) -> tuple[float, Interval]:
    """p-value and interval after so many further runs that go like those before."""
    a, b = found.a, found.b
    runs_a, runs_b = a.runs + more, b.runs + more
    if found.pairs is None:
        bad_a, bad_b = a.rate * runs_a, b.rate * runs_b
        p = _fisher(round(bad_a), runs_a, round(bad_b), runs_b)
        return p, newcombe(bad_a, runs_a, bad_b, runs_b)
    worse, better = (count * runs_a / a.runs for count in found.pairs)
    p = mcnemar_exact(round(worse), round(better))
    return p, paired_interval(worse, better, runs_a)


def _by_identity(variants: Iterable[VariantRuns]) -> dict[str, VariantRuns]:
    """Variants by their parameters, or by name if parameters are not unique."""
    found: dict[str, VariantRuns] = {}
    for variant in variants:
        parameters = json.dumps(variant.parameters, sort_keys=True) if variant.parameters else ""
        key = variant.name if not parameters or parameters in found else parameters
        found[key] = variant
    return found
