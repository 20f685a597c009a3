"""Read-only SQL queries over the tables of several campaigns."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence, Set
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.analysis.tables.csv_files import folded
from robovast.analysis.tables.database import (
    RECORDS,
    VIEW,
    confine,
    first_line,
    import_duckdb,
    runs_query,
)
from robovast.analysis.tables.query_errors import ONLY_READS, explain_error
from robovast.analysis.tables.runs import FACTOR, PARAMETER
from robovast.analysis.tables.spelling import plain
from robovast.analysis.tables.staging import (
    TableColumn,
    Types,
    joint_type,
    literal,
    plain_columns,
    quoted,
    tables_of,
)
from robovast.analysis.tables.stored import StoredTables, raise_failure, reachable
from robovast.base.errors import InputError, StorageError
from robovast.campaign.layout import COLUMNAR_TABLES

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection, Statement

_READ = {"SELECT", "MULTI"}
"""Kinds of statements that read: DESCRIBE, SUMMARIZE and SHOW are SELECT, too; PIVOT is MULTI."""
_MAKES = re.compile(r"create\b", re.IGNORECASE)
"""A table from a PIVOT."""
_EXPLAIN = re.compile(r"explain\b\s*(analyze\b)?\s*(\([^)]*\))?", re.IGNORECASE)
_OURS = "FROM duckdb_columns() WHERE database_name = 'memory' AND NOT internal"


@dataclass(frozen=True)
class Answer:
    """Result of a query."""

    columns: list[str]
    rows: list[tuple[Any, ...]]


@dataclass(frozen=True)
class _Part:
    """Rows of one campaign."""

    select: str
    types: Types
    plain: Set[str]
    """Columns whose whole numbers have no decimal point."""


def ask(campaigns: Sequence[Path | StoredTables], sql: str, most: int | None = None) -> Answer:
    """Query the tables of campaigns.

    All tables begin with the columns `campaign`, `config` and `run`; `runs` has one row per run.

    Args:
        campaigns: folders of campaigns that have been postprocessed, or tables elsewhere, of which
            only the parts that the query needs are read.
        sql: one statement in DuckDB's SQL; it can neither change data nor read other files.
        most: largest number of rows to read; None means all.

    Raises:
        CannotRunError: the extra `query` is not installed.
        InputError: no campaign has tables, or the query is invalid.
        StorageError: tables cannot be read.
    """
    duckdb = import_duckdb()
    if any("\ud800" <= sign <= "\udfff" for sign in sql):
        raise InputError("the query is not text in UTF-8.", hint="save the query in UTF-8")
    with _attached(campaigns) as connection:
        try:
            found = connection.execute(_reading(connection, sql))
            columns = [column[0] for column in found.description or ()]
            if not columns:
                return Answer([], [])
            return Answer(columns, found.fetchall() if most is None else found.fetchmany(most))
        except duckdb.Error as error:
            raise_failure(campaigns)
            raise explain_error(str(error), sql, _columns(connection)) from None
        except RuntimeError as error:  # how DuckDB reports Ctrl-C
            if "interrupted" not in str(error):
                raise
            raise KeyboardInterrupt from None


def tables(campaigns: Sequence[Path | StoredTables]) -> dict[str, Types]:
    """The tables with their columns and types; raises the same errors as `ask`."""
    with _attached(campaigns) as connection:
        return _columns(connection)


def _reading(connection: DuckDBPyConnection, sql: str) -> Statement:
    """The one statement of a query; raises an InputError if it does more than read."""
    statements = connection.extract_statements(sql)
    if not statements:
        raise InputError(
            "the query is empty.", hint="write a query, for example `SELECT * FROM runs`"
        )
    if len(statements) > 1:
        raise InputError(
            f"a query is one statement; there are {len(statements)}", hint="ask one by one"
        )
    (statement,) = statements
    explained_one = _EXPLAIN.match(statement.query)
    if explained_one:  # ANALYZE executes it
        _reading(connection, statement.query[explained_one.end() :])
    elif statement.type.name not in _READ or _MAKES.match(statement.query):
        raise InputError(f"the query is wrong: {ONLY_READS[0]}", hint=ONLY_READS[1])
    return statement


def _columns(connection: DuckDBPyConnection) -> dict[str, Types]:
    """The tables of the campaigns; of DuckDB's own, which it suggests, nobody asks."""
    found: dict[str, Types] = {}
    for table, column, type_ in connection.execute(
        f"SELECT table_name, column_name, data_type {_OURS} ORDER BY table_name, column_index"
    ).fetchall():
        found.setdefault(table, {})[column] = type_
    return found


@contextmanager
def _attached(campaigns: Sequence[Path | StoredTables]) -> Iterator[DuckDBPyConnection]:
    """Views over the tables of all campaigns.

    The files may come from anyone, so access to other files is disabled first, and only tables are
    used: a view in them would be executed here.
    """
    duckdb = import_duckdb()
    places = [place for campaign in campaigns if (place := _place(campaign))]
    with closing(duckdb.connect()) as connection, reachable(connection, campaigns):
        confine(connection, files=[path for _, path in places])
        members: dict[str, list[_Part]] = {}
        names: dict[str, str] = {}
        for index, (campaign, path) in enumerate(places):
            alias = f"campaign_{index}"
            try:
                connection.execute(f"ATTACH {literal(path)} AS {alias} (READ_ONLY)")
                parts = _parts(connection, alias, campaign)
            except duckdb.Error as error:
                raise_failure(campaigns)
                raise StorageError(
                    f"{path}: cannot be read: {first_line(error).rstrip('.')}",
                    hint="run `vast results postprocess --force` to create the file again",
                ) from error
            for table, part in parts.items():
                name = names.setdefault(folded(table), table)
                members.setdefault(name, []).append(part)
        if not members:
            raise InputError(
                "there are no tables to query", hint="create them with `vast results postprocess`"
            )
        try:
            for table, united in members.items():
                query = _union(connection, united, is_runs=table == VIEW)
                connection.execute(f"CREATE VIEW {quoted(table)} AS {query}")
        except duckdb.Error as error:
            raise_failure(campaigns)
            raise StorageError(
                f"the tables of these campaigns cannot be read together: {first_line(error)}",
                hint="run `vast results postprocess --force` to create the tables again",
            ) from error
        yield connection


def _place(campaign: Path | StoredTables) -> tuple[str, str] | None:
    """Name of a campaign and where its tables are; None if it has none."""
    if isinstance(campaign, StoredTables):
        return campaign.campaign, campaign.address
    path = campaign.absolute() / COLUMNAR_TABLES
    return (campaign.absolute().name, str(path)) if os.path.isfile(path) else None


def _parts(connection: DuckDBPyConnection, alias: str, campaign: str) -> dict[str, _Part]:
    """Queries for a campaign's rows, by table."""
    found = tables_of(connection, alias)
    sources = {name: f"{alias}.{quoted(name)}" for name in found if name != RECORDS}
    if RECORDS in found:
        sources = {**sources, VIEW: f"({runs_query(connection, found, alias)})"}
    ordered = sorted(sources, key=lambda name: (name != VIEW, name))
    noted = plain_columns(connection, alias)
    noted |= {(VIEW, f"{table}_{name}") for table, name in noted}
    return {
        table: _part(connection, campaign, sources[table], {n for of, n in noted if of == table})
        for table in ordered
    }


def _part(connection: DuckDBPyConnection, campaign: str, source: str, noted: Set[str]) -> _Part:
    select = f"SELECT {literal(campaign)} AS campaign, * FROM {source}"  # noqa: S608
    described = connection.execute(f"DESCRIBE {select}").fetchall()
    return _Part(select, {name: type_ for name, type_, *_ in described}, noted)


def _union(connection: DuckDBPyConnection, parts: Sequence[_Part], *, is_runs: bool) -> str:
    """A query for the rows of all parts; their columns may differ.

    Each campaign chose the types of its columns for itself. Of parameters, which have types by
    themselves, `1` and `1.0` are one value.
    """
    columns: dict[str, list[TableColumn]] = {}
    for part in parts:
        for name, type_ in part.types.items():
            columns.setdefault(folded(name), []).append(
                TableColumn(f"({part.select})", name, type_, name in part.plain)
            )
    joint = {
        key: joint_type(
            connection, own, spelt=not (is_runs and key.startswith((PARAMETER, FACTOR)))
        )
        for key, own in columns.items()
    }
    return " UNION ALL BY NAME ".join(
        _cast(part, {name: joint[folded(name)] for name in part.types}) for part in parts
    )


def _cast(part: _Part, types: Types) -> str:
    """The query of a part whose columns get types."""
    casts = ", ".join(
        f"({plain(cell) if name in part.plain else cell})::{type_} AS {cell}"
        for name, type_ in types.items()
        if type_ != part.types[name]
        for cell in [quoted(name)]
    )
    return f"SELECT * REPLACE ({casts}) FROM ({part.select})" if casts else part.select  # noqa: S608
