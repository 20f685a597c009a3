"""A report of a campaign as one HTML file, without script and without anything from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib.resources import files

from robovast.base.statistics import interval_text, percent
from robovast.campaign.log_lines import BAD
from robovast.campaign.verdict import Verdict
from robovast.evaluation.campaign_inputs import Change
from robovast.evaluation.campaign_report import Baseline, CampaignReport, Worst
from robovast.evaluation.matrix import Cell, Matrix
from robovast.evaluation.rates import IntervalOf, VariantRate, interval_for
from robovast_cli.ui import comparison, summary
from robovast_cli.ui.campaign_report import texts
from robovast_cli.ui.campaign_report.markup import Markup, joined, tag
from robovast_cli.ui.table import shortened

_SIGNS = {Verdict.PASSED: "✓", Verdict.FAILED: "✕", Verdict.ERRORED: "!", Verdict.INTERRUPTED: "–"}
_PALEST = 0.7
"""How much paler a cell is if its rate is unknown."""
_MOST_IN_PRINT = 8
"""Columns of a matrix that fit a printed page at full size."""
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""Forbids browsers to load anything, in case a text becomes markup in spite of the escaping."""


def to_html(report: CampaignReport) -> str:
    """The report."""
    title = shortened(report.about.title or report.rates.summary.name, texts.LONGEST_TEXT)
    style = files("robovast_cli.ui.campaign_report").joinpath("report.css").read_text("utf-8")
    head = tag(
        "head",
        Markup('<meta charset="utf-8">'),
        Markup(f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'),
        Markup('<meta name="viewport" content="width=device-width, initial-scale=1">'),
        tag("title", title),
        tag("style", Markup(style)),
    )
    body = tag("body", tag("header", *_begin(report, title)), tag("main", *_sections(report)))
    return f"<!doctype html>\n{tag('html', head, body, lang='en')}\n"


def _begin(report: CampaignReport, title: str) -> Iterable[Markup]:
    yield tag("h1", title)
    yield tag("p", texts.facts(report), class_="quiet")
    if report.about.description:
        yield tag("p", shortened(report.about.description, texts.LONGEST_TEXT))


def _sections(report: CampaignReport) -> Iterable[Markup]:
    lines = (tag("p", line) for line in summary.counts_text(report.rates).splitlines())
    yield _section("Summary", _verdicts(report), *lines)
    if report.baseline is not None:
        yield _baseline(report.baseline)
    if report.causes:
        yield _section("Causes of unsuccessful runs", _causes(report))
    effects = summary.clear_effects(report.explained.effects)
    if effects:
        table = _table("Factors", summary.EFFECT_COLUMNS, map(summary.effect_row, effects))
        yield _section("Factors that cause failures", table)
    if report.matrix.across.factor:
        yield _section(
            "Unsuccessful runs by factor",
            tag("p", texts.axes_note(report.explained), class_="quiet"),
            _matrix(report.matrix, report.units, interval_for(report.rates.summary)),
        )
    bad = [one for one in report.rates.configurations if one.rate.rate]
    if bad:
        yield _section("Worst configurations", *_configurations(bad))
    if report.worst:
        yield _section("Examples of unsuccessful runs", *map(_worst, report.worst))


def _section(title: str, *contents: Markup) -> Markup:
    return tag("section", tag("h2", title), *contents)


def _verdicts(report: CampaignReport) -> Markup:
    counts = report.rates.summary.counts
    items = (
        tag("li", tag("b", f"{_SIGNS[verdict]} {counts[verdict]:,}"), f" {verdict}", class_=verdict)
        for verdict in Verdict
        if counts[verdict]
    )
    return tag("ul", *items, class_="verdicts")


def _baseline(baseline: Baseline) -> Markup:
    found = baseline.comparison
    rows = list(
        map(comparison.difference_row, comparison.changed_variants(found)[: comparison.MOST_ROWS])
    )
    return _section(
        f"Compared with {baseline.name}: {comparison.headline(found)}",
        tag("p", found.statement),
        tag("p", comparison.sentence(found)),
        _table("Changed configurations", comparison.COLUMNS, rows) if rows else Markup(),
        *(tag("p", note, class_="quiet") for note in comparison.notes(found)),
        *map(_change, baseline.changes[: texts.MOST_CHANGES]),
    )


def _change(change: Change) -> Markup:
    shown = change.lines[: texts.MOST_CHANGED_LINES]
    left = len(change.lines) - len(shown) + change.more
    lines = [_diff_line(shortened(line, texts.WIDEST_LINE)) for line in shown]
    if left:
        lines.append(tag("span", f"… and {left} more lines", class_="quiet"))
    return joined(
        tag("h3", change.name, tag("span", f" {change.kind}", class_="quiet")),
        tag("pre", *lines) if lines else Markup(),
    )


def _diff_line(line: str) -> Markup:
    kind = {"+": "added", "-": "removed"}.get(line[:1], "")
    return tag("span", f"{line}\n", class_=kind)


def _causes(report: CampaignReport) -> Markup:
    shown = report.causes[: texts.MOST_CAUSES]
    most = len(shown[0].runs)
    rows = [
        [
            _bar(len(group.runs) / most, f"{len(group.runs):,}"),
            shortened(group.text, texts.LONGEST_TEXT),
            ", ".join(group.verdicts),
            group.runs[0],
        ]
        for group in shown
    ]
    left = len(report.causes) - len(shown)
    return joined(
        _table("Causes", summary.CAUSE_COLUMNS, rows),
        tag("p", f"… and {left} more causes", class_="quiet") if left else None,
    )


def _bar(share: float, text: str) -> Markup:
    style = f"--share: {100 * share:.1f}%"
    return tag("span", tag("span", Markup(), class_="fill", style=style), text, class_="bar")


def _matrix(found: Matrix, units: dict[str, str], interval_of: IntervalOf) -> Markup:
    across, down = (texts.titled(axis.factor, units) for axis in (found.across, found.down))
    corner = tag("td", f"{down} ↓ " if down else None, f"{across} →", class_="corner")
    labels = [tag("th", _label(label), scope="col") for label in found.across.labels]
    rows = (
        tag(
            "tr", tag("th", _label(label), scope="row"), *(_cell(cell, interval_of) for cell in row)
        )
        for label, row in zip(found.down.labels, found.cells, strict=True)
    )
    table = tag(
        "table",
        tag("thead", tag("tr", corner, *labels)),
        tag("tbody", *rows),
        class_="matrix wide" if len(labels) > _MOST_IN_PRINT else "matrix",
        style=f"--columns: {len(labels)}",
    )
    return _scrolling("Matrix of configurations", table)


def _label(label: str) -> str:
    return shortened(label, texts.WIDEST) or "all"


def _cell(cell: Cell, interval_of: IntervalOf) -> Markup:
    if not cell.runs:
        return tag("td", "–", class_="empty")
    interval = interval_of(cell.bad, cell.runs)
    rate = cell.bad / cell.runs
    sure = 1 - _PALEST * (interval[1] - interval[0])
    return tag(
        "td",
        percent(rate),
        tag("small", f" {cell.bad}/{cell.runs}"),
        tag("small", interval_text(interval)),
        style=f"--share: {100 * rate:.1f}%; --sure: {100 * sure:.1f}%",
    )


def _configurations(bad: Sequence[VariantRate]) -> Iterable[Markup]:
    columns, *rows = texts.configuration_table(bad)
    yield _table("Configurations", columns, rows)
    if len(bad) > len(rows):
        left = f"… and {len(bad) - len(rows):,} more with unsuccessful runs"
        yield tag("p", left, class_="quiet")


def _worst(worst: Worst) -> Markup:
    listed = (
        tag("div", tag("dt", name), tag("dd", text)) for name, text in texts.values(worst).items()
    )
    lines = (
        tag("span", f"{text}\n", class_="bad" if line and line.level in BAD else "")
        for line, text in texts.log_lines(worst)
    )
    path = worst.ending.path if worst.ending else ""
    return tag(
        "article",
        tag("h3", worst.variant.name),
        tag("p", texts.run_facts(worst)),
        tag("dl", *listed) if worst.variant.factors else None,
        _picture(worst),
        tag("p", f"End of {path}", class_="quiet") if path else None,
        tag("pre", *lines) if path else None,
    )


def _picture(worst: Worst) -> Markup | None:
    if not worst.picture:
        return tag("p", worst.missing, class_="quiet") if worst.missing else None
    key = f"{texts.MAP_KEY}; {worst.missing or texts.WAY_KEY}"
    note = f"{worst.variant.name}, run {worst.run.number}; {key}"
    return tag("figure", Markup(worst.picture), tag("figcaption", note, class_="quiet"))


def _table(name: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Markup:
    head = tag("tr", *(tag("th", column.capitalize(), scope="col") for column in columns))
    body = (tag("tr", *(tag("td", cell) for cell in row)) for row in rows)
    return _scrolling(name, tag("table", tag("thead", head), tag("tbody", *body)))


def _scrolling(name: str, table: Markup) -> Markup:
    """A table that may be wider than the page; keys scroll it, too."""
    return tag("div", table, class_="scroll", role="region", aria_label=name, tabindex="0")
