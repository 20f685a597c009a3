"""A comparison of two campaigns as text, JSON, Markdown and JUnit report."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict
from typing import Literal

from robovast.base.errors import ExitCode
from robovast.base.printable import printable_json
from robovast.base.statistics import percent
from robovast.campaign.junit import Case, Outcome, Suite, report_text
from robovast.evaluation.compare import Comparison, VariantDifference
from robovast.evaluation.rates import MOST_RUNS, Sample
from robovast_cli.ui.listing import format_table
from robovast_cli.ui.output import say_data

Format = Literal["text", "json"]

CHANGES = ("worse", "unclear", "better", "same")
"""In the order of tables."""
MOST_ROWS = 30
"""Most configurations in a text; those that did not change are left out of it."""

_COLUMNS = ["CHANGE", "CONFIGURATION", "BEFORE", "AFTER", "POINTS (95 %)", "P", "MORE RUNS"]


def print_comparison(base: str, new: str, found: Comparison, output: Format) -> None:
    """Print a comparison."""
    say_data(_json(base, new, found) if output == "json" else _text(base, new, found))


def exit_code(found: Comparison, fail_on: str) -> ExitCode:
    """What a comparison means for a pipeline."""
    if found.result == "worse":
        return ExitCode.TEST_FAILED
    return ExitCode.UNCLEAR if found.result == fail_on == "unclear" else ExitCode.OK


def markdown_text(base: str, new: str, found: Comparison) -> str:
    """A comment for a pull request."""
    lines = [
        f"### {_headline(found)}",
        "",
        f"`{new}` beside `{base}`: {found.statement}",
        "",
        _sentence(found),
    ]
    rows = [[_escaped(cell) for cell in _row(variant)] for variant in _changed(found)[:MOST_ROWS]]
    if rows:
        table = [_COLUMNS, ["---"] * len(_COLUMNS), *rows]
        lines += ["", *(f"| {' | '.join(row)} |" for row in table)]
    lines += ["", *_notes(found)]
    return "\n".join(lines).rstrip() + "\n"


def junit_report(base: str, new: str, found: Comparison) -> str:
    """A report with a case for all together and one for each configuration."""
    everything = Case("all configurations", _outcome(found.change), found.statement)
    cases = [
        Case(v.name_b, _outcome(v.change), f"{_share(v.difference.a)} → {_share(v.difference.b)}")
        for v in found.variants
    ]
    return report_text(f"{new} beside {base}", [Suite("comparison", [everything, *cases])])


def _outcome(change: str) -> Outcome:
    outcomes: dict[str, Outcome] = {"worse": "failure", "unclear": "skipped"}
    return outcomes.get(change, "passed")


def _json(base: str, new: str, found: Comparison) -> str:
    data = {"base": base, "new": new, "result": found.result, **asdict(found)}
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"


def _text(base: str, new: str, found: Comparison) -> str:
    changed = _changed(found)
    table = format_table(_COLUMNS, map(_row, changed[:MOST_ROWS])) + "\n" if changed else ""
    lines = [f"{new} beside {base}: {_headline(found)}", found.statement, _sentence(found)]
    return table + "\n".join([*lines, *_notes(found)]) + "\n"


def _headline(found: Comparison) -> str:
    match found.result:
        case "worse":
            return "worse"
        case "better":
            return "better"
        case "same":
            return f"not worse by {percent(found.margin)} or more"
        case _:
            return "unclear whether it got worse"


def _sentence(found: Comparison) -> str:
    counts = Counter(variant.change for variant in found.variants)
    told = ", ".join(f"{counts[change]} {change}" for change in CHANGES)
    text = f"{_counted(len(found.variants), 'configuration')} in both: {told}."
    if found.change != "unclear":
        return text
    more = _more(found.more_runs)
    return f"{text} {more} more runs of both campaigns would decide it, if they go as before."


def _notes(found: Comparison) -> Iterable[str]:
    changed = len(_changed(found))
    if changed > MOST_ROWS:
        yield f"{changed - MOST_ROWS} more configurations are worse, unclear or better (JSON)."
    for names, where in ((found.only_a, "before"), (found.only_b, "after")):
        if names:
            yield f"{_counted(len(names), 'configuration')} only {where}: not compared."


def _changed(found: Comparison) -> list[VariantDifference]:
    changed = [variant for variant in found.variants if variant.change != "same"]
    return sorted(changed, key=lambda variant: CHANGES.index(variant.change))


def _row(variant: VariantDifference) -> list[str]:
    found = variant.difference
    return [
        variant.change,
        variant.name_b,
        _share(found.a),
        _share(found.b),
        f"{_points(found.b.rate - found.a.rate)} ({_points(found.low)} to {_points(found.high)})",
        f"{variant.adjusted_p:.2g}",
        _more(variant.more_runs) if variant.change == "unclear" else "",
    ]


def _points(share: float) -> str:
    return f"{round(100 * share):+d}"


def _more(runs: int | None) -> str:
    return f"> {MOST_RUNS}" if runs is None else str(runs)


def _share(sample: Sample) -> str:
    return f"{sample.bad} of {sample.runs}"


def _counted(number: int, noun: str) -> str:
    return f"1 {noun}" if number == 1 else f"{number} {noun}s"


def _escaped(cell: str) -> str:
    """A cell that ends neither its column nor its line, and is no markup."""
    for character in "\\`|<>[]_*":
        cell = cell.replace(character, f"\\{character}")
    return cell
