"""Texts about the comparison of two campaigns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from robovast.base.statistics import percent
from robovast.evaluation.compare import Change, Comparison, VariantDifference
from robovast.evaluation.rates import MOST_RUNS, Sample
from robovast_cli.ui.table import counted

CHANGES: tuple[Change, ...] = ("worse", "unclear", "better", "same")
"""In the order of tables."""
MOST_ROWS = 30
"""Maximum number of configurations in a text, which omits unchanged ones."""

COLUMNS = [
    "CHANGE",
    "CONFIGURATION",
    "BEFORE",
    "AFTER",
    "PERCENTAGE POINTS (95 %)",
    "P-VALUE",
    "MORE RUNS",
]


def headline(found: Comparison) -> str:
    """The result of a comparison in a few words."""
    rise = percent(found.margin)
    equal = found.overall.a.rate == found.overall.b.rate
    equal = equal and all(variant.change == "same" for variant in found.variants)
    match found.result:
        case "worse" | "better":
            return found.result
        case "same":
            return "no difference" if equal else f"not worse by {rise} or more"
        case _ if equal:
            return f"unclear: no difference, but too few runs to exclude a rise by {rise}"
        case _:
            before, now = (percent(side.rate) for side in (found.overall.a, found.overall.b))
            if before == now:
                return "unclear: no change in total, but configurations differ"
            verb = "rose" if found.overall.b.rate > found.overall.a.rate else "fell"
            change = f"the rate {verb} from {before} to {now}"
            return f"unclear: {change}, but chance can explain the change"


def sentence(found: Comparison) -> str:
    """Count the configurations by change, and state the runs that would give a decision."""
    counts = Counter(variant.change for variant in found.variants)
    changes = ", ".join(f"{counts[change]} {change}" for change in CHANGES)
    text = f"{counted(len(found.variants), 'configuration')} in both: {changes}."
    if found.change != "unclear":
        return text
    more = _more(found.more_runs)
    needed = f"{more} more runs of both campaigns would give a decision"
    return f"{text} {needed} if the rates stay the same."


def notes(found: Comparison) -> Iterable[str]:
    """Describe the configurations that the tables omit."""
    changed = len(changed_variants(found))
    if changed > MOST_ROWS:
        yield f"{changed - MOST_ROWS} more configurations changed. The JSON output lists them."
    for names, where in ((found.only_a, "baseline"), (found.only_b, "new campaign")):
        if names:
            yield f"{counted(len(names), 'configuration')} only in the {where}, not compared."


def changed_variants(found: Comparison) -> list[VariantDifference]:
    """Configurations that did not stay the same, in the order of `CHANGES`."""
    changed = [variant for variant in found.variants if variant.change != "same"]
    return sorted(changed, key=lambda variant: CHANGES.index(variant.change))


def difference_row(variant: VariantDifference) -> list[str]:
    """Cells for `COLUMNS`."""
    found = variant.difference
    return [
        variant.change,
        variant.name_b,
        share_text(found.a),
        share_text(found.b),
        f"{_points(found.b.rate - found.a.rate)} ({_points(found.low)} to {_points(found.high)})",
        f"{variant.adjusted_p:.2g}",
        _more(variant.more_runs) if variant.change == "unclear" else "",
    ]


def _points(share: float) -> str:
    return f"{round(100 * share):+d}"


def _more(runs: int | None) -> str:
    return f"> {MOST_RUNS}" if runs is None else str(runs)


def share_text(sample: Sample) -> str:
    """Count the unsuccessful runs: `15 of 20`."""
    return f"{sample.bad} of {sample.runs}"
