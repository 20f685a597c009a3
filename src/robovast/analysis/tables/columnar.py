"""`_execution/tables.duckdb`: the tables of a campaign, stored by column.

In measurements it was as small and fast as Parquet, and single runs can be replaced without
rewriting the others.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from contextlib import closing, contextmanager
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import TYPE_CHECKING

from robovast.analysis.tables.csv_files import (
    KEYS,
    column_names,
    csv_files,
    folded,
    is_plain,
    read_header,
)
from robovast.analysis.tables.database import (
    METRICS,
    RECORDS,
    VIEW,
    confine,
    first_line,
    has_one_row_a_run,
    import_duckdb,
    runs_query,
)
from robovast.analysis.tables.runs import Row, run_rows
from robovast.analysis.tables.spelling import type_of
from robovast.analysis.tables.staging import (
    append,
    literal,
    quoted,
    stage,
    stage_small,
    tables_of,
)
from robovast.base.errors import StorageError
from robovast.campaign.layout import COLUMNAR_TABLES, Layout
from robovast.campaign.run_record import COLUMNS

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection

Columns = Set[tuple[str, str]]
"""Columns, as table and name, both folded."""
KEY_TYPES = {"config": "VARCHAR", "run": "INTEGER"}
_SERIES = "many rows for each run"
_UNFINISHED = ""
"""Version of a run whose rows are being written; after a crash such rows are removed."""
_BATCH = 2000
"""Number of CSV files read at once."""
_SMALL = 16 << 10
"""Size of CSV files from which DuckDB is faster than Python [bytes]."""


def update_columnar(layout: Layout, versions: Mapping[str, str]) -> None:
    """Update the tables of a campaign.

    Args:
        layout: the campaign's layout.
        versions: version of each run, as `<variant>/<number>`; runs are read again if their version
            has changed.

    Raises:
        CannotRunError: the extra `query` is not installed.
        StorageError: the file cannot be written, or another program has it open.
    """
    with (
        TemporaryDirectory(prefix="robovast-tables-") as scratch,
        _connected(layout, Path(scratch)) as connection,
    ):
        rows = connection.execute("SELECT path, version FROM loaded").fetchall()
        loaded: dict[str, str] = dict(rows)
        stale = [run for run, version in versions.items() if loaded.get(run) != version]
        gone = [run for run in loaded if versions.get(run) != loaded[run]]
        if not stale and not gone:
            return
        _remove(connection, gone)
        texts = _load(connection, layout, stale, Path(scratch))
        if texts and len(stale) < len(versions):  # all cells together may have another type
            stale = list(versions)
            texts = _load_again(connection, layout, stale, Path(scratch))
        if texts:
            stale = list(versions)
            _load_again(connection, layout, stale, Path(scratch), texts)
        _join_metrics(connection)
        _claim(connection, stale, versions)


def write_runs(path: Path, rows: Sequence[Row]) -> None:
    """Replace a file by one that has the rows of runs and no other table.

    Args:
        path: the file, in an existing folder.
        rows: as `run_rows` makes them.

    Raises:
        CannotRunError: the extra `query` is not installed.
        StorageError: the file cannot be written.
    """
    duckdb = import_duckdb()
    try:
        path.unlink(missing_ok=True)
        with (
            TemporaryDirectory(prefix="robovast-tables-") as scratch,
            closing(duckdb.connect(str(path))) as connection,
        ):
            _load_rows(connection, rows, Path(scratch))
            _join_metrics(connection)
    except (OSError, duckdb.Error) as error:
        raise StorageError(f"{path}: cannot be written: {first_line(error)}") from error


def _load_again(
    connection: DuckDBPyConnection,
    layout: Layout,
    runs: Sequence[str],
    scratch: Path,
    texts: Columns = frozenset(),
) -> Columns:
    """Replace all tables by new ones; see `_load`."""
    for table in tables_of(connection):
        connection.execute(f"DROP TABLE {quoted(table)}")
    connection.execute("DELETE FROM loaded")
    return _load(connection, layout, runs, scratch, texts)


def _load(
    connection: DuckDBPyConnection,
    layout: Layout,
    runs: Sequence[str],
    scratch: Path,
    texts: Columns = frozenset(),
) -> Columns:
    """Append the rows of runs.

    Args:
        connection: connection to the tables.
        layout: the campaign's layout.
        runs: paths of the runs, as `<variant>/<number>`.
        scratch: folder for temporary files.
        texts: columns that are text.

    Returns:
        Columns with different types in different files; they must be read again as text.
    """
    _claim(connection, runs, dict.fromkeys(runs, _UNFINISHED))
    found = set(_load_rows(connection, list(run_rows(layout, runs)), scratch, texts))
    return found | _load_csv_files(connection, layout, runs, scratch, texts)


def _claim(
    connection: DuckDBPyConnection, runs: Sequence[str], versions: Mapping[str, str]
) -> None:
    """Record the versions of runs in the tables."""
    named = {"p": list(runs), "v": [versions[run] for run in runs]}
    connection.execute("BEGIN")
    connection.execute("DELETE FROM loaded WHERE path IN (SELECT unnest($p))", {"p": named["p"]})
    connection.execute("INSERT INTO loaded SELECT unnest($p), unnest($v)", named)
    connection.execute("COMMIT")


@contextmanager
def _connected(layout: Layout, scratch: Path) -> Iterator[DuckDBPyConnection]:
    duckdb = import_duckdb()
    path = layout.root / COLUMNAR_TABLES
    try:
        layout.execution.mkdir(exist_ok=True)
        with closing(_connect(duckdb, path)) as connection:
            confine(connection, folders=(layout.root.absolute(), scratch))
            yield connection
    except (OSError, duckdb.Error) as error:
        raise StorageError(f"{path}: cannot be written: {first_line(error)}") from error


def _connect(duckdb: ModuleType, path: Path) -> DuckDBPyConnection:
    """Open the file; a damaged or foreign one is recreated, since all its content is derived."""
    if path.is_fifo():  # to open it would wait for a writer
        path.unlink()
    try:
        connection: DuckDBPyConnection = duckdb.connect(str(path))
    except duckdb.Error as error:
        if "lock" in str(error):
            raise
    else:
        if _is_ours(connection):
            connection.execute("CREATE TABLE IF NOT EXISTS loaded (path VARCHAR, version VARCHAR)")
            return connection
        connection.close()
    path.unlink()
    connection = duckdb.connect(str(path))
    connection.execute("CREATE TABLE loaded (path VARCHAR, version VARCHAR)")
    return connection


def _is_ours(connection: DuckDBPyConnection) -> bool:
    """Whether it has no view besides ours; reading a foreign view would execute it."""
    found = connection.execute("SELECT view_name FROM duckdb_views() WHERE NOT internal").fetchall()
    return all(name == VIEW for (name,) in found)


def _remove(connection: DuckDBPyConnection, runs: Sequence[str]) -> None:
    if not runs:
        return
    keys = [run.rpartition("/") for run in runs]
    named = {"c": [key[0] for key in keys], "r": [int(key[2]) for key in keys]}
    for table in tables_of(connection):
        connection.execute(
            f"DELETE FROM {quoted(table)} WHERE (config, run) IN "  # noqa: S608
            "(SELECT (unnest($c), unnest($r)))",
            named,
        )
    connection.execute("DELETE FROM loaded WHERE path IN (SELECT unnest($p))", {"p": list(runs)})


def _load_rows(
    connection: DuckDBPyConnection,
    rows: Sequence[Row],
    scratch: Path,
    texts: Columns = frozenset(),
) -> Columns:
    """Append rows of runs; texts stay texts, even if they look like numbers."""
    spelt = dict(_spelt(tuple(COLUMNS)))
    for row in rows:
        for name, spelling in _spelt(tuple(row)).items():
            spelt.setdefault(name, spelling)
    columns = list(spelt.values())
    cells = [
        {
            name: None if value == "" and spelt[name] in COLUMNS else value
            for name, value in zip(_spelt(tuple(row)), row.values(), strict=True)
        }
        for row in rows
    ]
    path = scratch / "records.csv"
    with path.open("w", encoding="utf-8", errors="replace", newline="") as file:
        file.write("," * (len(spelt) - 1) + "\n")  # names may have line breaks
        written = (
            file.write(",".join(_quoted_cell(line.get(name)) for name in spelt) + "\n")
            for line in cells
        )
        longest = max(written, default=0)
    stage(connection, [path], columns, quoted_is_text=True, longest=longest)
    types = {spelt[name]: type_of([line.get(name) for line in cells]) for name in spelt}
    return append(
        connection, RECORDS, columns, {**types, **COLUMNS, **_as_text(texts, RECORDS, columns)}
    )


def _quoted_cell(value: object) -> str:
    """A value as a cell; None is empty, and a text without letters is `""`."""
    if value is None:
        return ""
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return '"' + text.replace('"', '""') + '"'


def _as_text(texts: Columns, table: str, columns: Iterable[str]) -> dict[str, str]:
    return {name: "VARCHAR" for name in columns if (folded(table), folded(name)) in texts}


@lru_cache(maxsize=64)  # most runs of a campaign have equal names
def _spelt(names: tuple[str, ...]) -> Mapping[str, str]:
    """Names of a run's columns, by what SQL takes for the same; equal ones get numbers."""
    return {folded(name): name for name in column_names(names, ())}


def _load_csv_files(
    connection: DuckDBPyConnection,
    layout: Layout,
    runs: Iterable[str],
    scratch: Path,
    texts: Columns,
) -> Columns:
    respelt: set[tuple[str, str]] = set()
    for (table, header), files in _grouped(layout, runs).items():
        columns = column_names(header)
        fixed = KEY_TYPES | _as_text(texts, table, columns)
        for part in _parts(files):
            if _is_small(part[0]):
                stage_small(connection, layout.root, part, columns, scratch)
            else:
                _stage_large(connection, layout.root, part, columns, scratch)
            respelt |= append(connection, table, [*KEYS, *columns], fixed)
    return respelt


def _parts(files: Sequence[Path]) -> Iterator[Sequence[Path]]:
    """Groups of files to read at once: small ones, and limited numbers of large ones."""
    small = list(filter(_is_small, files))
    large = sorted(set(files).difference(small))
    for listed in (small, large):
        yield from (listed[start : start + _BATCH] for start in range(0, len(listed), _BATCH))


def _is_small(path: Path) -> bool:
    """Whether a file is read by us: DuckDB reads large files faster, but only the common form."""
    return path.stat().st_size < _SMALL or not is_plain(path)


def _stage_large(
    connection: DuckDBPyConnection,
    root: Path,
    files: Sequence[Path],
    columns: Sequence[str],
    scratch: Path,
) -> None:
    import duckdb

    try:
        stage(connection, files, columns, root)
    except duckdb.Error:  # read a damaged file as far as possible
        stage_small(connection, root, files, columns, scratch)


def _grouped(layout: Layout, runs: Iterable[str]) -> dict[tuple[str, tuple[str, ...]], list[Path]]:
    """Files by table and header; the files of a group are read at once."""
    groups: dict[tuple[str, tuple[str, ...]], list[Path]] = {}
    for run in runs:
        for table, path in csv_files(layout.run(run)).items():
            header = tuple(read_header(path))
            if header:
                groups.setdefault((table, header), []).append(path)
    return groups


def _join_metrics(connection: DuckDBPyConnection) -> None:
    """Mark tables of metrics, and create the view `runs` for direct users of the file."""
    tables = tables_of(connection)
    for table in tables:
        note = METRICS if has_one_row_a_run(connection, quoted(table)) else _SERIES
        connection.execute(f"COMMENT ON TABLE {quoted(table)} IS {literal(note)}")
    query = runs_query(connection, tables)
    connection.execute(f"CREATE OR REPLACE VIEW {VIEW} AS {query}")
