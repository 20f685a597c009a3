"""Statistics of passed and failed runs, by `math` alone: how sure a rate or a difference is.

The tests hold the functions against SciPy, which is far too large for the core.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from math import exp, lgamma, log, sqrt

LEVEL = 0.05
"""Significance level of all statements; intervals have 1 - LEVEL."""
_Z = 1.959964
_ROUNDING = 1e-7
"""Part of a percent by which computing misses 0 and 100 at most."""
_NEGLIGIBLE = 1e-17
"""Part of a sum that does not change it."""
_STEPS = 50
"""Bisections of an interval's limit; they leave 1e-15."""

Interval = tuple[float, float]
"""Lower and upper limit."""


def wilson(bad: float, runs: float) -> Interval:
    """95 % interval of a rate whose number of runs was fixed beforehand (Wilson's score)."""
    if not runs:
        return 0.0, 1.0
    rate, z = bad / runs, _Z
    centre = (rate + z * z / (2 * runs)) / (1 + z * z / runs)
    half = z / (1 + z * z / runs) * sqrt(rate * (1 - rate) / runs + z * z / (4 * runs * runs))
    return max(0.0, centre - half), min(1.0, centre + half)


def anytime(bad: float, runs: float) -> Interval:
    """95 % interval of a rate that stays valid however often one looks while runs are added.

    The beta-binomial confidence sequence of a uniform prior: all rates p with
    (runs + 1) · C(runs, bad) · p^bad · (1 - p)^(runs - bad) of at least `LEVEL`.
    """
    constant = log(runs + 1) + log_choose(runs, bad) - log(LEVEL)

    def is_possible(p: float) -> bool:
        return constant + _times_log(bad, p) + _times_log(runs - bad, 1 - p) >= 0

    rate = bad / runs if runs else 0.5
    return _limit(is_possible, rate, 0.0), _limit(is_possible, rate, 1.0)


def newcombe(bad_a: float, runs_a: float, bad_b: float, runs_b: float) -> Interval:
    """95 % interval of the difference of two rates, b - a, from Wilson's intervals."""
    (low_a, high_a), (low_b, high_b) = wilson(bad_a, runs_a), wilson(bad_b, runs_b)
    a, b = (bad / runs if runs else 0.0 for bad, runs in ((bad_a, runs_a), (bad_b, runs_b)))
    low = b - a - sqrt((b - low_b) ** 2 + (high_a - a) ** 2)
    high = b - a + sqrt((high_b - b) ** 2 + (a - low_a) ** 2)
    return low, high


def fisher_exact(a: int, b: int, c: int, d: int) -> float:
    """Two-sided p-value of the table [[a, b], [c, d]]: sums all tables that are not more likely."""
    row, column, total = a + b, a + c, a + b + c + d
    low, high = max(0, row + column - total), min(row, column)
    middle = min(max(low, (row + 1) * (column + 1) // (total + 2)), high)  # the most likely
    constant = log_choose(total, column)

    def probability(x: int) -> float:
        return exp(log_choose(row, x) + log_choose(total - row, column - x) - constant)

    def fewer(x: int) -> float:
        return x * (total - row - column + x) / ((row - x + 1) * (column - x + 1))

    def more(x: int) -> float:
        return (row - x) * (column - x) / ((x + 1) * (total - row - column + x + 1))

    limit = probability(a) * (1 + 1e-7)
    left = low - 1 + bisect_right(range(low, middle + 1), limit, key=probability)
    right = high + 1 - bisect_right(range(high, middle, -1), limit, key=probability)
    below = _tail(probability(left), left, -1, fewer) if left >= low else 0.0
    above = _tail(probability(right), right, 1, more) if right <= high else 0.0
    return min(1.0, below + above)


def mcnemar_exact(worse: int, better: int) -> float:
    """Two-sided p-value of pairs of which so many got worse and better."""
    pairs, few = worse + better, min(worse, better)
    first = exp(log_choose(pairs, few) - pairs * log(2))
    return min(1.0, 2 * _tail(first, few, -1, lambda k: k / (pairs - k + 1)))


def _tail(term: float, x: int, step: int, ratio: Callable[[int], float]) -> float:
    """The sum of terms from that of `x` on, until they do not matter."""
    total = 0.0
    while term > total * _NEGLIGIBLE:
        total += term
        term *= ratio(x)
        x += step
    return total


def paired_interval(worse: float, better: float, pairs: float) -> Interval:
    """95 % interval of the difference of two rates by pairs (Agresti and Min, 2005)."""
    pairs, difference = pairs + 2, worse - better
    spread = _Z * sqrt(worse + better + 1 - difference * difference / pairs)
    return max(-1.0, (difference - spread) / pairs), min(1.0, (difference + spread) / pairs)


def holm(values: Sequence[float]) -> list[float]:
    """p-values with Holm's correction, in the given order."""
    adjusted = [0.0] * len(values)
    highest = 0.0
    for rank, index in enumerate(sorted(range(len(values)), key=values.__getitem__)):
        highest = max(highest, min(1.0, values[index] * (len(values) - rank)))
        adjusted[index] = highest
    return adjusted


def log_choose(n: float, k: float) -> float:
    """Logarithm of the binomial coefficient."""
    return lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)


def percent(share: float) -> str:
    """A share as people read it: `7.5 %`, `12 %`; only none is `0 %`, and only all `100 %`."""
    value = 100 * share
    if min(value, 100 - value) < _ROUNDING:
        return f"{value:.0f} %"
    if not 0.05 <= value < 99.95:
        return "<0.1 %" if value < 50 else ">99.9 %"
    return f"{value:.0f} %" if 9.95 <= value < 99.5 else f"{value:.1f} %"


def interval_text(interval: Interval) -> str:
    """An interval of shares as people read it: `3.6 – 62 %`."""
    low, high = interval
    return f"{percent(low).removesuffix(' %')} – {percent(high)}"


def least(enough: Callable[[int], bool], most: int) -> int | None:
    """The least number from 1 to `most` that is enough; None if none is.

    Whatever is above a number that is enough must be so, too.
    """
    if not enough(most):
        return None
    low, high = 0, most
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def _times_log(count: float, p: float) -> float:
    if not count:
        return 0.0
    return count * log(p) if p > 0 else float("-inf")


def _limit(is_possible: Callable[[float], bool], inside: float, end: float) -> float:
    """The limit between a possible value and an end of the scale."""
    if is_possible(end):
        return end
    for _ in range(_STEPS):
        middle = (inside + end) / 2
        inside, end = (middle, end) if is_possible(middle) else (inside, middle)
    return (inside + end) / 2
