"""Writes tables, metadata and the graph after the commands, if anything changed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from robovast.analysis.postprocessing.content import combined, digests
from robovast.analysis.postprocessing.events import (
    Failure,
    Options,
    PostprocessingObserver,
    PostprocessingSummary,
)
from robovast.analysis.postprocessing.state import TableState, Unit
from robovast.analysis.postprocessing.survey import OWN, WHOLE, Survey
from robovast.base.errors import RobovastError
from robovast.base.optional_deps import QUERY
from robovast.base.version import __version__
from robovast.campaign.layout import COLUMNAR_TABLES, SQLITE_TABLES, Layout
from robovast.model.naming import CAMPAIGN_STORE, GRAPH, METADATA

TABLES = 2
"""Version of the tables' columns; after a change all runs are read again."""


@dataclass(frozen=True)
class _Part:
    """A result that is made from a whole campaign."""

    name: str
    files: tuple[Path, ...]
    write: Callable[[], None]
    incremental: bool = False
    """The result is updated incrementally, so repeating it must start from scratch."""


def finish(
    survey: Survey,
    state: TableState,
    units: Mapping[str, Unit],
    options: Options,
    observer: PostprocessingObserver,
    summary: PostprocessingSummary,
) -> None:
    """Write those results of a whole campaign that are out of date.

    Args:
        survey: the campaign's survey.
        state: stores the files that each result was made from.
        units: the campaign's units after all commands.
        options: which results to leave out.
        observer: receives progress events.
        summary: collects failures.
    """
    if find_spec("duckdb") is None and summary.worked and not options.skip_tables:
        observer.message(str(QUERY.missing("duckdb", "The file `tables.duckdb`")))
    versions = {path: _version(unit) for path, unit in units.items() if path != WHOLE}
    layout = Layout(survey.campaign)
    documents = digests(layout.config, (path.name for path in layout.documents))
    now = f"{__version__} {combined({**versions, **documents})}"
    for part in _parts(survey, versions, options):
        there = all(os.path.isfile(path) for path in part.files)
        if there and not options.force and state.note(part.name) == now:
            continue
        observer.step_started(part.name, 1)
        state.set_note(part.name, "")
        if options.force and part.incremental:
            for path in part.files:
                path.unlink(missing_ok=True)
        if _succeeded(part, observer, summary):
            state.set_note(part.name, now)
            summary.written.append(part.name)
        observer.step_advanced()


def _version(unit: Unit) -> str:
    """A digest that changes with the content of any file of a unit."""
    return combined({"inputs": unit.inputs, "tables": str(TABLES), **unit.made})


def _parts(survey: Survey, versions: Mapping[str, str], options: Options) -> Iterator[_Part]:
    layout = Layout(survey.campaign)
    runs = {path: version for path, version in versions.items() if path != OWN}
    if not options.skip_tables:
        yield from _tables(layout, survey.document, runs)
    if not options.skip_metadata:
        files = (layout.root / METADATA, layout.root / GRAPH)
        yield _Part("metadata", files, lambda: _describe(layout.root))


def _tables(layout: Layout, document: Path | None, runs: Mapping[str, str]) -> Iterator[_Part]:
    from robovast.analysis.tables.campaign_store import write_campaign_store
    from robovast.analysis.tables.sqlite_tables import update_sqlite

    columnar, rows = layout.root / COLUMNAR_TABLES, layout.root / SQLITE_TABLES
    if find_spec("duckdb") is not None:
        yield _Part("tables", (columnar,), lambda: _update_columnar(layout, runs), incremental=True)
    yield _Part(rows.name, (rows,), lambda: update_sqlite(layout, runs), incremental=True)
    yield _Part(
        CAMPAIGN_STORE,
        (layout.root / CAMPAIGN_STORE,),
        lambda: write_campaign_store(layout, document, runs),
    )


def _update_columnar(layout: Layout, runs: Mapping[str, str]) -> None:
    from robovast.analysis.tables.columnar import update_columnar

    update_columnar(layout, runs)


def _succeeded(
    part: _Part, observer: PostprocessingObserver, summary: PostprocessingSummary
) -> bool:
    try:
        part.write()
    except RobovastError as error:
        failure = Failure(summary.campaign.name, part.name, "", str(error), error.exit_code)
        summary.failures.append(failure)
        observer.failed(failure)
        return False
    return True


def _describe(campaign: Path) -> None:
    from robovast.analysis.provenance import describe

    describe(campaign)
