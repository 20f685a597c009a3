"""Campaigns and their baseline: a row for each configuration, a column for each campaign."""

from __future__ import annotations

import json
from collections.abc import Sequence

from robovast.base.errors import ExitCode
from robovast.base.printable import printable_json
from robovast.base.statistics import LEVEL, percent
from robovast.campaign.junit import report_text
from robovast.evaluation.compare import Comparison, VariantDifference
from robovast_cli.ui.comparison import (
    CHANGES,
    MOST_ROWS,
    Format,
    comparison_data,
    exit_code,
    headline,
    junit_report,
    markdown_text,
    print_comparison,
    share_text,
    suite,
)
from robovast_cli.ui.markdown import code, markdown_table
from robovast_cli.ui.output import say_data
from robovast_cli.ui.table import format_table

Compared = Sequence[tuple[str, Comparison]]
"""Each campaign's name, and how it differs from the baseline."""

_SIGNS = {"worse": " ▲", "better": " ▼", "unclear": " ?", "same": ""}
_KEY = "Unsuccessful runs: ▲ worse, ▼ better, ? unclear"


def print_comparisons(base: str, found: Compared, output: Format) -> None:
    """Print how campaigns differ from a baseline."""
    if len(found) == 1:
        print_comparison(base, *found[0], output)
        return
    say_data(_json(base, found) if output == "json" else _text(base, found))


def exit_code_of_all(found: Compared, fail_on: str) -> ExitCode:
    """Return the exit code of the worst comparison."""
    codes = {exit_code(one, fail_on) for _, one in found}
    ordered = (ExitCode.TEST_FAILED, ExitCode.UNCLEAR)
    return next((one for one in ordered if one in codes), ExitCode.OK)


def markdown_of_all(base: str, found: Compared) -> str:
    """A comment for a pull request."""
    if len(found) == 1:
        return markdown_text(base, *found[0])
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


def junit_of_all(base: str, found: Compared) -> str:
    """A report with a suite for each campaign."""
    if len(found) == 1:
        return junit_report(base, *found[0])
    return report_text(f"compared with {base}", [suite(new, one) for new, one in found])


def _json(base: str, found: Compared) -> str:
    data = {"base": base, "comparisons": [comparison_data(base, new, one) for new, one in found]}
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"


def _text(base: str, found: Compared) -> str:
    columns, rows, left = _table(base, found)
    table = f"{format_table(columns, rows)}\n{_KEY}\n\n" if rows else ""
    lines = [f"{new} compared with {base}: {headline(one)}\n{one.statement}" for new, one in found]
    return table + "\n".join([*lines, *left, _caution(base, len(found))]) + "\n"


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
