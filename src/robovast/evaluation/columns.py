"""All runs of a campaign as columns, which are a tenth of the size of objects and fast to parse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robovast.campaign.decisions import CampaignTest, told
from robovast.campaign.failure_groups import causes
from robovast.campaign.verdict import Verdict
from robovast.evaluation.summaries import VariantRuns, decision_of

VERDICTS = list(Verdict)
"""Verdicts; a verdict's index is its code."""


def columns(variants: Sequence[VariantRuns], test: CampaignTest | None = None) -> dict[str, Any]:
    """Variants and runs of a campaign, and what its test says of each variant in `decided`.

    Returns:
        `verdicts`: names of the codes. `variants`: `name`, `entry` and, by factor or parameter,
        `values`, each a list with one item per variant. `factors`: names of what was varied;
        `units`: of those that have one. `runs`: lists with one item per run: `variant`
        (place in the list of variants), `number`, `verdict` (code), `reason` (place in
        `reasons`), `started` [s since the epoch], `duration` [s]. `causes`: what reasons with one
        cause share; `numbers`: ranges of the numbers in which they differ; `cause`: the place in
        both of each reason.
    """
    factors = list(dict.fromkeys(name for variant in variants for name in variant.factors))
    names = dict.fromkeys([*factors, *(name for v in variants for name in v.parameters)])
    runs = [(place, run) for place, variant in enumerate(variants) for run in variant.runs]
    reasons = {"": 0}
    for _, run in runs:
        reasons.setdefault(run.reason, len(reasons))
    bad = (run.reason for _, run in runs if run.verdict is not Verdict.PASSED)
    known = causes(bad)
    cause_of = causes(reason for reason in reasons if reason not in known) | known
    place_of = {cause: place for place, cause in enumerate(dict.fromkeys(cause_of.values()))}
    codes = {verdict: code for code, verdict in enumerate(VERDICTS)}
    return {
        "verdicts": VERDICTS,
        "decided": [told(decision_of(test, one)) for one in variants] if test else [],
        "reasons": list(reasons),
        "causes": [cause.label for cause in place_of],
        "numbers": [cause.numbers for cause in place_of],
        "cause": [place_of[cause_of[reason]] for reason in reasons],
        "variants": {
            "name": [variant.name for variant in variants],
            "entry": [variant.entry for variant in variants],
            "values": {name: [_value(variant, name) for variant in variants] for name in names},
        },
        "factors": [name for name in factors if not name.startswith("_")],
        "units": {name: unit for variant in variants for name, unit in variant.units.items()},
        "runs": {
            "variant": [place for place, _ in runs],
            "number": [run.number for _, run in runs],
            "verdict": [codes[run.verdict] for _, run in runs],
            "reason": [reasons[run.reason] for _, run in runs],
            "started": [_rounded(run.started_at) for _, run in runs],
            "duration": [_rounded(run.duration) for _, run in runs],
        },
    }


def _value(variant: VariantRuns, name: str) -> Any:
    return variant.stated[name] if name in variant.stated else variant.parameters.get(name)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
