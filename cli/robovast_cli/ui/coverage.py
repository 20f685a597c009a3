"""Coverage of a campaign as text, and the .vast file that runs the coverage gaps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.base.statistics import interval_text, percent
from robovast.evaluation.coverage import EntryCoverage, Pair
from robovast.model.designs import completing
from robovast.model.document import Document
from robovast.model.expansion.expand import expand_rows
from robovast_cli.ui.table import WIDEST_CELL, format_table, shortened


def coverage_text(entries: Sequence[EntryCoverage], most: int) -> str:
    """Describe the coverage of each entry.

    Args:
        entries: the coverage of each.
        most: lines of each table; 0 means all.
    """
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


def holes_text(document: Document, entries: Sequence[EntryCoverage]) -> tuple[str, int]:
    """Return a document whose configurations run each missing pair, and their number.

    Raises:
        InputError: no pair is missing, or values are random, or files are generated.
    """
    made: list[dict[str, Any]] = []
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
                f"`{found.entry.name}` generates files, which a .vast file cannot list."
            )
        made += [
            {
                "name": variant.name,
                "parameters": [{name: value} for name, value in variant.parameters.items()],
            }
            for variant in variants
        ]
    if not made:
        raise InputError("no coverage gaps: every pair of values was run.")
    return dump_yaml({**document.source.data, "configuration": made}), len(made)
