"""A report of a campaign as Markdown: for a pull request, an issue or a wiki."""

from __future__ import annotations

from collections.abc import Iterator

from robovast.evaluation.campaign_inputs import Change
from robovast.evaluation.campaign_report import Baseline, CampaignReport, Worst
from robovast.evaluation.effects import Effect
from robovast.evaluation.matrix import Matrix
from robovast.evaluation.rates import VariantRate
from robovast_cli.ui import comparison, summary
from robovast_cli.ui.campaign_report import texts
from robovast_cli.ui.markdown import code, code_block, escaped, markdown_table, table_of_markup
from robovast_cli.ui.table import shortened


def to_markdown(report: CampaignReport) -> str:
    """The report; below 65,536 characters, the most that GitHub takes."""
    title = shortened(report.about.title or report.rates.summary.name, texts.LONGEST_TEXT)
    lines = [
        f"## {escaped(title)}",
        "",
        code(texts.facts(report)),
        "",
        *(f"- {line}" for line in summary.counts_text(report.rates).splitlines()),
        *_baseline(report.baseline),
        *_causes(report),
        *_effects(report.explained.effects),
        *_matrix(report),
        *_configurations(report.rates.configurations),
    ]
    for worst in report.worst:
        lines += _worst(worst)
    return "\n".join(lines) + "\n"


def _baseline(baseline: Baseline | None) -> Iterator[str]:
    if baseline is None:
        return
    found = baseline.comparison
    yield from ("", f"### Compared with {code(baseline.name)}: {comparison.headline(found)}", "")
    yield from (escaped(found.statement), "", comparison.sentence(found), "")
    shown = comparison.changed_variants(found)[: comparison.MOST_ROWS]
    if shown:
        yield from markdown_table(comparison.COLUMNS, map(comparison.difference_row, shown))
        yield ""
    yield from comparison.notes(found)
    for change in baseline.changes[: texts.MOST_CHANGES]:
        yield from _change(change)


def _change(change: Change) -> Iterator[str]:
    yield from ("", f"<details><summary>{code(change.name)} {change.kind}</summary>", "")
    lines = change.lines[: texts.MOST_CHANGED_LINES]
    yield from code_block((shortened(line, texts.WIDEST) for line in lines), "diff")
    yield from ("", "</details>")


def _causes(report: CampaignReport) -> Iterator[str]:
    if not report.causes:
        return
    yield from ("", "### Causes of unsuccessful runs", "")
    shown = report.causes[: texts.MOST_CAUSES]
    yield from table_of_markup(
        summary.CAUSE_COLUMNS,
        (
            [
                str(len(group.runs)),
                code(shortened(group.text, texts.WIDEST_LINE)),
                ", ".join(group.verdicts),
                code(group.runs[0]),
            ]
            for group in shown
        ),
    )
    if len(report.causes) > len(shown):
        yield from ("", f"… and {len(report.causes) - len(shown)} more causes")


def _effects(effects: list[Effect]) -> Iterator[str]:
    clear = summary.clear_effects(effects)
    if clear:
        yield from ("", "### Factors that cause failures", "")
        yield from markdown_table(summary.EFFECT_COLUMNS, map(summary.effect_row, clear))


def _matrix(report: CampaignReport) -> Iterator[str]:
    found: Matrix = report.matrix
    if not found.across.factor:
        return
    yield from (
        "",
        "### Unsuccessful runs by factor",
        "",
        escaped(texts.axes_note(report.explained)),
        "",
    )
    across, down = (texts.titled(axis.factor, report.units) for axis in (found.across, found.down))
    labels = [shortened(label, texts.WIDEST) for label in found.across.labels]
    rows = (
        [shortened(label, texts.WIDEST), *map(texts.cell_text, row)]
        for label, row in zip(found.down.labels, found.cells, strict=True)
    )
    yield from markdown_table([f"{down} ↓ {across} →".strip(), *labels], rows)


def _configurations(configurations: list[VariantRate]) -> Iterator[str]:
    bad = [one for one in configurations if one.rate.rate]
    if not bad:
        return
    yield from ("", "### Worst configurations", "")
    columns, *rows = texts.configuration_table(bad)
    yield from markdown_table(columns, rows)
    if len(bad) > len(rows):
        yield from ("", f"… and {len(bad) - len(rows):,} more with unsuccessful runs")


def _worst(worst: Worst) -> Iterator[str]:
    yield from ("", f"<details><summary>{code(worst.variant.name)}: end of a run</summary>", "")
    named = ", ".join(f"{code(name)} {escaped(text)}" for name, text in texts.values(worst).items())
    yield from (named, "", escaped(texts.run_facts(worst)), "")
    lines = texts.log_lines(worst)
    if lines:
        yield from code_block(text for _, text in lines)
    yield from ("", "</details>")
