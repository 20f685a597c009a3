"""Compares two campaigns: what got worse, and whether chance explains it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass

from robovast.base.statistics import LEVEL, fisher_exact, holm, newcombe
from robovast.evaluation.rates import Sample, sample
from robovast.evaluation.summaries import VariantRuns


@dataclass(frozen=True, slots=True)
class Difference:
    """Two samples, and the probability of such a difference by chance."""

    a: Sample
    b: Sample
    p: float
    """Two-sided p-value of Fisher's exact test."""
    low: float
    """Lower limit of the 95 % interval of the difference of rates, b - a (Newcombe)."""
    high: float


@dataclass(frozen=True, slots=True)
class VariantDifference:
    """One variant in both campaigns."""

    name_a: str
    name_b: str
    difference: Difference
    adjusted_p: float
    """Holm's correction for the number of variants."""
    change: str
    """`worse` or `better` if the adjusted p-value is below `LEVEL`; `same` if the rates are equal;
    otherwise `unclear`."""


@dataclass(frozen=True)
class Comparison:
    """Two campaigns, matched variant by variant."""

    overall: Difference
    """All matched variants together."""
    statement: str
    variants: list[VariantDifference]
    """Sorted by p-value, the smallest first."""
    only_a: list[str]
    only_b: list[str]


def compare(a: Iterable[VariantRuns], b: Iterable[VariantRuns]) -> Comparison:
    """Compare campaign b with campaign a by variants with equal parameters."""
    left, right = _by_identity(a), _by_identity(b)
    common = [key for key in left if key in right]
    pairs = [(left[key], right[key]) for key in common]
    differences = [difference(sample(one), sample(other)) for one, other in pairs]
    adjusted = holm([d.p for d in differences])
    variants = [
        VariantDifference(one.name, other.name, found, p, _change(found, p))
        for (one, other), found, p in zip(pairs, differences, adjusted, strict=True)
    ]
    overall = difference(sample(*(one for one, _ in pairs)), sample(*(other for _, other in pairs)))
    return Comparison(
        overall=overall,
        statement=state(overall),
        variants=sorted(variants, key=lambda variant: variant.difference.p),
        only_a=[variant.name for key, variant in left.items() if key not in right],
        only_b=[variant.name for key, variant in right.items() if key not in left],
    )


def difference(a: Sample, b: Sample) -> Difference:
    """Test whether the rates of two samples differ."""
    p = fisher_exact(a.bad, a.runs - a.bad, b.bad, b.runs - b.bad)
    low, high = newcombe(a.bad, a.runs, b.bad, b.runs)
    return Difference(a, b, p, low, high)


def state(found: Difference) -> str:
    """Describe a difference in words."""
    a, b = found.a, found.b
    if not a.runs or not b.runs:
        return "Nothing can be compared: the campaigns share no variant with runs in both."
    verb = "rose" if b.rate > a.rate else "fell" if b.rate < a.rate else "stayed the same"
    certain = "chance alone hardly explains that" if found.p < LEVEL else "chance can explain that"
    text = (
        f"The share of runs that did not pass {verb}, from {a.rate:.1%} ({a.bad} of {a.runs}) to "
        f"{b.rate:.1%} ({b.bad} of {b.runs})"
    )
    interval = f"95 % interval {100 * found.low:+.1f} to {100 * found.high:+.1f} points"
    p = f"p = {found.p:.2g}" if found.p >= 0.0001 else "p < 0.0001"
    return f"{text}; {certain} (Fisher's exact test, {p}; {interval})."


def _change(found: Difference, p: float) -> str:
    if p >= LEVEL:
        return "same" if found.a.rate == found.b.rate else "unclear"
    return "worse" if found.b.rate > found.a.rate else "better"


def _by_identity(variants: Iterable[VariantRuns]) -> dict[str, VariantRuns]:
    """Variants by their parameters, or by name if parameters are not unique."""
    found: dict[str, VariantRuns] = {}
    for variant in variants:
        parameters = json.dumps(variant.parameters, sort_keys=True) if variant.parameters else ""
        key = variant.name if not parameters or parameters in found else parameters
        found[key] = variant
    return found
