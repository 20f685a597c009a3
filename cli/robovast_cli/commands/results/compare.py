"""`vast results compare`: a gate for CI."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from robovast.base.atomic import write_report
from robovast.base.errors import ExitCode, InputError
from robovast.base.statistics import LEVEL, percent
from robovast.campaign.junit import Case, Suite, report_text
from robovast.campaign.verdict import Outcome
from robovast.evaluation.compare import Comparison, VariantDifference
from robovast.evaluation.compare import compare as compare_variants
from robovast_cli.commands.results.options import (
    ReportFormat,
    ResultsDir,
    named_campaign,
    read_campaign,
)
from robovast_cli.lazy import examples, exit_codes
from robovast_cli.ui.comparison import (
    CHANGES,
    COLUMNS,
    MOST_ROWS,
    changed_variants,
    difference_row,
    headline,
    notes,
    sentence,
    share_text,
)
from robovast_cli.ui.markdown import code, markdown_table
from robovast_cli.ui.output import echo_data, echo_json
from robovast_cli.ui.table import format_table

Compared = Sequence[tuple[str, Comparison]]
"""Name of each campaign, and its comparison with the baseline."""

_CAMPAIGN = "folder of a campaign, or its name in the results folder"
_SIGNS = {"worse": " ▲", "better": " ▼", "unclear": " ?", "same": ""}
_KEY = "Unsuccessful runs: ▲ worse, ▼ better, ? unclear"


@exit_codes(
    "0 not worse, or unclear · 1 a configuration or all together are worse · "
    "2 comparison impossible · 6 unclear, with --fail-on unclear"
)
@examples(
    ("vast results compare hall-2026-03-04-132444 hall-2026-03-05-132444", "Compare two"),
    ("vast results compare before after --fail-on unclear --junit gate.xml", "Set up a CI gate"),
)
def compare(
    ctx: typer.Context,
    base: Annotated[str, typer.Argument(metavar="BASE", help=f"Baseline: {_CAMPAIGN}.")],
    new: Annotated[
        list[str],
        typer.Argument(
            metavar="NEW…", help="Campaigns to compare, by folder or by name in the results folder."
        ),
    ],
    results_dir: ResultsDir = None,
    fail_on: Annotated[
        Literal["worse", "unclear"],
        typer.Option("--fail-on", help="Least severe result that gives a nonzero exit code."),
    ] = "worse",
    margin: Annotated[
        float,
        typer.Option(
            metavar="RATE", help="Tolerated rise of the failure rate. At least 0 and below 1."
        ),
    ] = 0.05,
    junit: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Output file for a JUnit report.")
    ] = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Output file for a comment of a pull request."),
    ] = None,
    output: ReportFormat = "text",
) -> None:
    """Compare campaigns with a baseline.

    Configurations with equal parameters are compared one by one and all together. The test is
    McNemar's exact test if their runs have equal seeds, otherwise Fisher's, with Holm's correction
    for the number of configurations. Each campaign is compared with BASE on its own.
    """
    if not 0 <= margin < 1:
        raise InputError(
            f"--margin {margin:g}: the rate must be at least 0 and below 1",
            hint="use for example `--margin 0.05`",
        )
    results = results_dir or ctx.obj.results
    place = named_campaign(results, base)
    before = read_campaign(place)
    found = []
    for name in new:
        other = named_campaign(results, name)
        after = before if other == place else read_campaign(other)
        one = compare_variants(before.variants, after.variants, margin)
        if not one.overall.a.runs or not one.overall.b.runs:
            raise InputError(
                f"cannot compare {before.name} and {after.name}: no configuration has equal "
                "parameters and runs with a verdict in both campaigns.",
                hint="compare campaigns of the same .vast file",
            )
        found.append((after.name, one))
    for path, report in ((junit, _junit), (markdown, _markdown)):
        if path is not None:
            write_report(path, report(before.name, found))
    if output == "json":
        data = [_data(before.name, name, one) for name, one in found]
        echo_json(data[0] if len(data) == 1 else {"base": before.name, "comparisons": data})
    else:
        echo_data(_text(before.name, found))
    raise typer.Exit(_exit_code(found, fail_on))


def _exit_code(found: Compared, fail_on: str) -> ExitCode:
    """Return the exit code of the worst comparison."""
    results = {one.result for _, one in found}
    if "worse" in results:
        return ExitCode.TEST_FAILED
    return ExitCode.UNCLEAR if fail_on == "unclear" and "unclear" in results else ExitCode.OK


def _data(base: str, new: str, found: Comparison) -> dict[str, Any]:
    return {"base": base, "new": new, "result": found.result, **asdict(found)}


def _markdown(base: str, found: Compared) -> str:
    """Return a comment for a pull request."""
    if len(found) == 1:
        return _markdown_of_one(base, *found[0])
    columns, rows, left = _table(base, found)
    lines = [
        f"### {len(found)} campaigns compared with {code(base)}",
        "",
        *(f"- {code(new)}: {headline(one)}" for new, one in found),
        "",
        *([*markdown_table(columns, rows), "", _KEY] if rows else ["No configuration changed."]),
        "",
        *left,
        _caution(base, len(found)),
    ]
    return "\n".join(lines) + "\n"


def _markdown_of_one(base: str, new: str, found: Comparison) -> str:
    lines = [
        f"### {headline(found)}",
        "",
        f"`{new}` compared with `{base}`: {found.statement}",
        "",
        sentence(found),
    ]
    rows = [difference_row(variant) for variant in changed_variants(found)[:MOST_ROWS]]
    if rows:
        lines += ["", *markdown_table(COLUMNS, rows)]
    lines += ["", *notes(found)]
    return "\n".join(lines).rstrip() + "\n"


def _junit(base: str, found: Compared) -> str:
    """Return a report with a suite for each campaign."""
    if len(found) == 1:
        new, comparison = found[0]
        return report_text(f"{new} compared with {base}", [_suite("comparison", comparison)])
    return report_text(f"compared with {base}", [_suite(new, one) for new, one in found])


def _suite(name: str, found: Comparison) -> Suite:
    """Return a case for all configurations together and one for each."""
    everything = Case("all configurations", _outcome(found.change), found.statement)
    cases = [
        Case(
            v.name_b,
            _outcome(v.change),
            f"{share_text(v.difference.a)} → {share_text(v.difference.b)}",
        )
        for v in found.variants
    ]
    return Suite(name, [everything, *cases])


def _outcome(change: str) -> Outcome:
    outcomes: dict[str, Outcome] = {"worse": "failure", "unclear": "skipped"}
    return outcomes.get(change, "passed")


def _text(base: str, found: Compared) -> str:
    if len(found) == 1:
        return _text_of_one(base, *found[0])
    columns, rows, left = _table(base, found)
    table = f"{format_table(columns, rows)}\n{_KEY}\n\n" if rows else ""
    lines = [f"{new} compared with {base}: {headline(one)}\n{one.statement}" for new, one in found]
    return table + "\n".join([*lines, *left, _caution(base, len(found))]) + "\n"


def _text_of_one(base: str, new: str, found: Comparison) -> str:
    changed = changed_variants(found)
    table = (
        format_table(COLUMNS, map(difference_row, changed[:MOST_ROWS])) + "\n" if changed else ""
    )
    lines = [f"{new} compared with {base}: {headline(found)}", found.statement, sentence(found)]
    return table + "\n".join([*lines, *notes(found)]) + "\n"


def _caution(base: str, number: int) -> str:
    chance = percent(1 - (1 - LEVEL) ** number)
    return (
        f"Each campaign is compared with {base} separately. Chance alone makes at least one of "
        f"{number} campaigns worse in up to {chance} of all cases."
    )


def _table(base: str, found: Compared) -> tuple[list[str], list[list[str]], list[str]]:
    """Columns, rows of configurations that changed in any campaign, and omitted rows.

    Rows are in the order of `CHANGES`, by the first change of each; a configuration has the name
    that it has in the baseline.
    """
    by_name = [{one.name_a: one for one in comparison.variants} for _, comparison in found]
    names = dict.fromkeys(name for variants in by_name for name in variants)
    rows = [[variants.get(name) for variants in by_name] for name in names]
    changed = [
        (_rank(row), name, row) for name, row in zip(names, rows, strict=True) if _rank(row)[0]
    ]
    changed.sort(key=lambda item: item[0], reverse=True)
    left = len(changed) - MOST_ROWS
    return (
        ["CONFIGURATION", base, *(new for new, _ in found)],
        [[name, *_cells(row)] for _, name, row in changed[:MOST_ROWS]],
        [f"{left} more configurations changed. The JSON output lists them."] if left > 0 else [],
    )


def _rank(row: Sequence[VariantDifference | None]) -> tuple[int, int]:
    """How bad the worst change of a row is, and in how many campaigns; 0 without any."""
    changes = [one.change for one in row if one is not None]
    bad = [len(CHANGES) - 1 - CHANGES.index(change) for change in changes]
    worst = max(bad, default=0)
    return worst, bad.count(worst)


def _cells(row: Sequence[VariantDifference | None]) -> list[str]:
    before = next(one.difference.a for one in row if one is not None)
    return [
        share_text(before),
        *("–" if one is None else share_text(one.difference.b) + _SIGNS[one.change] for one in row),
    ]
