"""SQL over the tables of several campaigns, read-only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.errors import InputError, StorageError
from robovast.results.layout import Layout
from robovast.tables.columnar import FILE, VIEW, first_line, import_duckdb
from robovast.tables.staging import Types, quoted

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection


@dataclass(frozen=True)
class Answer:
    """What a query returns."""

    columns: list[str]
    rows: list[tuple[Any, ...]]


def ask(campaigns: Sequence[Path], sql: str, most: int | None = None) -> Answer:
    """Ask the tables of campaigns.

    Every table has the columns `campaign`, `config` and `run` in front; `runs` has one row a run.

    Args:
        campaigns: folders of campaigns that have been postprocessed.
        sql: one statement in DuckDB's SQL; it can read nothing else and change nothing.
        most: rows that are read; all when None.

    Raises:
        CannotRunError: the extra `query` is not installed.
        InputError: none of the campaigns has tables, or the query is wrong.
        StorageError: tables cannot be read.
    """
    duckdb = import_duckdb()
    with _attached(campaigns) as connection:
        try:
            found = connection.execute(sql)
            if found is None:  # blanks and comments alone
                raise InputError("the query is empty.")
            columns = [column[0] for column in found.description or ()]
            if not columns:
                return Answer([], [])
            return Answer(columns, found.fetchall() if most is None else found.fetchmany(most))
        except duckdb.Error as error:
            raise InputError(f"the query is wrong: {str(error).strip()}") from None


def tables(campaigns: Sequence[Path]) -> dict[str, Types]:
    """The tables that can be asked, with their columns and types; raises as `ask` does."""
    with _attached(campaigns) as connection:
        found: dict[str, Types] = {}
        for table, column, type_ in connection.execute(
            "SELECT table_name, column_name, data_type FROM duckdb_columns() "
            "WHERE database_name = 'memory' AND NOT internal ORDER BY table_name, column_index"
        ).fetchall():
            found.setdefault(table, {})[column] = type_
        return found


@contextmanager
def _attached(campaigns: Sequence[Path]) -> Iterator[DuckDBPyConnection]:
    """Views over the tables of all campaigns; from here on no file can be opened any more."""
    duckdb = import_duckdb()
    with closing(duckdb.connect()) as connection:
        members: dict[str, list[tuple[str, str]]] = {}
        for index, campaign in enumerate(campaigns):
            path = Layout(campaign).execution / FILE
            if not path.exists():
                continue
            alias = f"campaign_{index}"
            try:
                connection.execute(f"ATTACH {_literal(str(path))} AS {alias} (READ_ONLY)")
            except duckdb.Error as error:
                raise StorageError(f"{path}: cannot be read: {first_line(error)}") from error
            for table in _public(connection, alias):
                members.setdefault(table, []).append((alias, campaign.absolute().name))
        if not members:
            raise InputError(
                "there are no tables to ask: `vast results postprocess` makes them (with the extra "
                "`query`)."
            )
        for table, places in members.items():
            connection.execute(_view(table, places))
        connection.execute("SET enable_external_access = false")
        connection.execute("SET lock_configuration = true")
        yield connection


def _public(connection: DuckDBPyConnection, alias: str) -> list[str]:
    found = connection.execute(
        "SELECT table_name FROM information_schema.tables WHERE table_catalog = $alias "
        "AND table_name NOT IN ('loaded', 'run_records') ORDER BY table_name <> $view, table_name",
        {"alias": alias, "view": VIEW},
    )
    return [row[0] for row in found.fetchall()]


def _view(table: str, places: Sequence[tuple[str, str]]) -> str:
    """All rows of a table, whatever columns it has in which campaign."""
    parts = (
        f"SELECT {_literal(campaign)} AS campaign, * FROM {alias}.{quoted(table)}"  # noqa: S608
        for alias, campaign in places
    )
    return f"CREATE VIEW {quoted(table)} AS {' UNION ALL BY NAME '.join(parts)}"


def _literal(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"
