"""`vast results coverage`: combinations that were run, and coverage gaps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from robovast.base.atomic import write_report
from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.base.statistics import interval_text, percent
from robovast.campaign.configurations import document_path, read_configurations
from robovast.campaign.layout import Layout
from robovast.evaluation.coverage import EntryCoverage, Pair, campaign_coverage
from robovast.model.designs import completing
from robovast.model.document import Document, load_document
from robovast.model.expansion.expand import expand_rows
from robovast_cli.commands.results.options import (
    CampaignName,
    ResultsDir,
    named_campaign,
    read_campaign,
)
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo, echo_data
from robovast_cli.ui.table import WIDEST_CELL, counted, format_table, shortened


@examples(
    ("vast results coverage results/hall-2026-03-04-152130", "Show failures and gaps"),
    ("vast results coverage hall-2026-03-04-152130 --holes gaps.vast", "Write the missing runs"),
)
def coverage(
    ctx: typer.Context,
    campaign: CampaignName,
    results_dir: ResultsDir = None,
    buckets: Annotated[
        int | None,
        typer.Option(
            min=1, max=1000, metavar="N", help="Number of equal intervals that group random values."
        ),
    ] = None,
    worst: Annotated[
        int,
        typer.Option(
            "--worst", min=0, metavar="N", help="Maximum length of each table. 0 lists everything."
        ),
    ] = 10,
    holes: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Output .vast file that runs the missing pairs. Write it into the folder of the "
            "campaign's .vast file.",
        ),
    ] = None,
) -> None:
    """Show failed pairs of values, and coverage gaps.

    A pair consists of two values of different variations. Its failure rate counts all runs with
    both values, and has Wilson's interval. A coverage gap is a pair that was never run.
    """
    folder = named_campaign(results_dir or ctx.obj.results, campaign)
    layout = Layout(folder)
    document = load_document(document_path(layout, read_configurations(layout)))
    found = campaign_coverage(document, read_campaign(folder).variants, buckets)
    echo_data(_coverage_text(found, worst))
    if holes is not None:
        text, count = _gaps_document(document, found)
        write_report(holes, text)
        echo(f"{holes}: {counted(count, 'configuration')}. To run: vast -V {holes} exec local run")


def _coverage_text(entries: Sequence[EntryCoverage], most: int) -> str:
    """Describe the coverage of each entry in tables of at most `most` lines (0: all)."""
    return "\n".join("".join(_entry(entry, most)) for entry in entries)


def _entry(found: EntryCoverage, most: int) -> Iterator[str]:
    shares = [f"{w} {a} of {b} ({percent(a / b)})" for w, (a, b) in found.covered().items()]
    yield (
        f"{found.entry.name}: {len(found.counts):,} of {found.product:,} combinations; "
        f"{', '.join(shares)}\n"
    )
    bad = found.bad_pairs()
    if bad:
        rows = map(_row, bad[: most or None])
        yield format_table(["PAIR", "UNSUCCESSFUL", "RATE", "95 % INTERVAL"], rows)
        yield _more(len(bad), most)
    holes = found.holes()
    if holes:
        yield "\n" if bad else ""
        yield format_table(
            ["COVERAGE GAP"], [[shortened(hole, WIDEST_CELL)] for hole in holes[: most or None]]
        )
        yield _more(len(holes), most)


def _row(pair: Pair) -> list[str]:
    rate = percent(pair.bad / pair.runs)
    counts = f"{pair.bad} of {pair.runs}"
    return [shortened(pair.values, WIDEST_CELL), counts, rate, interval_text(pair.interval)]


def _more(count: int, most: int) -> str:
    return f"… and {count - most} more (`--worst 0` shows all)\n" if most and count > most else ""


def _gaps_document(document: Document, entries: Sequence[EntryCoverage]) -> tuple[str, int]:
    """Return a document whose configurations run each missing pair, and their number.

    Raises:
        InputError: no pair is missing, or values are random, or files are generated.
    """
    configurations: list[dict[str, Any]] = []
    for found in entries:
        rows = completing(found.counts, found.sizes)
        if rows and any(axis.drawn for axis in found.axes):
            raise InputError(
                f"`{found.entry.name}` has random values",
                hint="increase their number in the .vast file",
            )
        variants = expand_rows(document, found.entry, rows) if rows else []
        if any(variant.files for variant in variants):
            raise InputError(
                f"`{found.entry.name}` generates files, which a .vast file cannot list.",
                hint="exclude this configuration",
            )
        configurations += [
            {
                "name": variant.name,
                "parameters": [{name: value} for name, value in variant.parameters.items()],
            }
            for variant in variants
        ]
    if not configurations:
        raise InputError("no coverage gaps: every pair of values was run.")
    return dump_yaml({**document.source.data, "configuration": configurations}), len(configurations)
