"""What writers and readers of a campaign's tables in DuckDB share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from robovast.analysis.tables.csv_files import KEYS
from robovast.analysis.tables.staging import Types, literal, quoted
from robovast.base.optional_deps import QUERY

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection

RECORDS = "run_records"
"""Table of run records; the view `runs` adds metrics."""
VIEW = "runs"
METRICS = "one row for each run"
"""Comment on such a table."""


def import_duckdb() -> ModuleType:
    """Import the package `duckdb`.

    Raises:
        CannotRunError: it is not installed.
    """
    with QUERY.needed_by("SQL over tables"):
        import duckdb
    return duckdb


def confine(
    connection: DuckDBPyConnection,
    files: Iterable[Path | str] = (),
    folders: Iterable[Path] = (),
) -> None:
    """Restrict a connection to these databases and to files in these folders."""
    names = [f"{path}{suffix}" for path in files for suffix in ("", ".wal")]
    connection.execute(f"SET allowed_paths = {_listed(names)}")
    connection.execute(f"SET allowed_directories = {_listed(map(str, folders))}")
    connection.execute("SET enable_external_access = false")
    connection.execute("SET lock_configuration = true")


def _listed(texts: Iterable[str]) -> str:
    return f"[{', '.join(map(literal, texts))}]"


def first_line(error: Exception) -> str:
    """An error's message without the query."""
    return str(error).strip().partition("\n")[0]


def runs_query(
    connection: DuckDBPyConnection, tables: Mapping[str, Types], catalog: str | None = None
) -> str:
    """A query for run records and for CSV files with one row per run.

    Args:
        connection: connection to the tables.
        tables: the tables with their columns.
        catalog: name of an attached file; None means the connection's own.
    """
    place = f"{catalog}." if catalog else ""
    columns = [f"{quoted(RECORDS)}.*"]
    joins = [f"{place}{quoted(RECORDS)} AS {quoted(RECORDS)}"]
    for table in _metrics(connection, tables, catalog):
        columns += [
            f"{quoted(table)}.{quoted(name)} AS {quoted(f'{table}_{name}')}"
            for name in tables[table]
            if name not in KEYS
        ]
        source = f"{place}{quoted(table)} AS {quoted(table)}"
        joins.append(f"LEFT JOIN {source} USING (config, run)")
    return f"SELECT {', '.join(columns)} FROM {' '.join(joins)}"  # noqa: S608


def _metrics(
    connection: DuckDBPyConnection, tables: Iterable[str], catalog: str | None
) -> list[str]:
    """Tables with one row per run; in older files, without marks, they are examined."""
    noted = dict(
        connection.execute(
            "SELECT table_name, comment FROM duckdb_tables() "
            "WHERE database_name = coalesce($catalog, current_database()) "
            "AND schema_name = 'main'",
            {"catalog": catalog},
        ).fetchall()
    )
    place = f"{catalog}." if catalog else ""
    return [
        table
        for table in tables
        if table != RECORDS
        and (
            noted[table] == METRICS
            if noted[table]
            else has_one_row_a_run(connection, place + quoted(table))
        )
    ]


def has_one_row_a_run(connection: DuckDBPyConnection, table: str) -> bool:
    """Whether a table has one row for each run at most."""
    found = connection.execute(
        f"SELECT 1 FROM {table} GROUP BY config, run HAVING count(*) > 1 LIMIT 1"  # noqa: S608
    )
    return found.fetchone() is None
