"""Loads CSV files into DuckDB: first as text into a table `staged`, then typed into their table.

Types are inferred from all values: a single value that is not a number makes a column text.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from robovast.analysis.tables.csv_files import KEYS, folded, read_rows

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection

Types = dict[str, str]
"""Columns in order, with their types."""

_NUMBERS = ("BIGINT", "DOUBLE")
_AT_ONCE = 100
"""Columns that are examined at once; time grows with the square of their number."""
_FIXED = ("BIGINT", "DOUBLE", "BOOLEAN", "VARCHAR")
"""Types to try; the first that fits all values is used."""


def quoted(name: str) -> str:
    """Quote a name for SQL."""
    return '"' + name.replace('"', '""') + '"'


def literal(text: str) -> str:
    """Quote a text for SQL."""
    return "'" + text.replace("'", "''") + "'"


def tables_of(connection: DuckDBPyConnection, catalog: str | None = None) -> dict[str, Types]:
    """All tables with rows of runs, with their columns; views are excluded.

    Args:
        connection: connection to the tables.
        catalog: name of an attached file; None means the connection's own.
    """
    found: dict[str, Types] = {}
    for table, column, type_ in connection.execute(
        "SELECT t.table_name, column_name, data_type FROM duckdb_tables() t "
        "JOIN duckdb_columns() c USING (database_oid, table_oid) "
        "WHERE t.database_name = coalesce($catalog, current_database()) AND NOT t.temporary "
        "AND t.schema_name = 'main' AND t.table_name <> 'loaded' "
        "ORDER BY t.table_name, column_index",
        {"catalog": catalog},
    ).fetchall():
        found.setdefault(table, {})[column] = type_
    return found


def stage_small(
    connection: DuckDBPyConnection,
    root: Path,
    files: Iterable[Path],
    columns: Sequence[str],
    scratch: Path,
) -> None:
    """Read CSV files of runs via one temporary file; for many small files, and damaged ones.

    Args:
        connection: receives the table `staged`, which begins with the columns `config` and `run`.
        root: folder of the runs; files are in `<config>/<run>` below it.
        files: files with the same header.
        columns: names for the header's cells.
        scratch: folder for the temporary file.
    """
    path = scratch / "rows.csv"
    with path.open("w", encoding="utf-8", newline="") as whole:
        writer = csv.writer(whole)
        writer.writerow([*KEYS, *columns])
        for file in files:
            run = file.relative_to(root).parts[:2]
            writer.writerows([*run, *row] for row in read_rows(file, len(columns)))
    stage(connection, [path], [*KEYS, *columns])


def stage(
    connection: DuckDBPyConnection,
    files: Sequence[Path],
    columns: Sequence[str],
    root: Path | None = None,
) -> None:
    """Read CSV files as text into the table `staged`.

    Args:
        connection: receives the table.
        files: files with the same header.
        columns: names for the header's cells.
        root: folder of the runs; adds the columns `config` and `run` in front.

    Raises:
        duckdb.Error: a file is damaged.
    """
    cells = {f"c{index}": "VARCHAR" for index in range(len(columns))}
    chosen = [f"{cell} AS {quoted(name)}" for cell, name in zip(cells, columns, strict=True)]
    if root is not None:
        below = f"substr(_file, {len(str(root)) + len(os.sep) + 1})"
        keys = (f"split_part({below}, '/', {n}) AS {key}" for n, key in enumerate(KEYS, 1))
        chosen[:0] = keys
    connection.execute(
        f"CREATE OR REPLACE TEMP TABLE staged AS SELECT {', '.join(chosen)} FROM "  # noqa: S608
        "read_csv($files, columns = $cells, header = true, auto_detect = false, delim = ',', "
        "quote = '\"', escape = '\"', nullstr = '', filename = '_file')",
        {"files": [str(path) for path in files], "cells": cells},
    )


def append(
    connection: DuckDBPyConnection, table: str, columns: Sequence[str], fixed: Mapping[str, str]
) -> None:
    """Append the staged rows to a table; create it, or extend its columns and types, as needed.

    Args:
        connection: connection with the table `staged`.
        table: name of the target table.
        columns: columns of `staged`.
        fixed: known types of columns; others are inferred.
    """
    free = [name for name in columns if name not in fixed]
    types = {**_found_types(connection, free), **{n: fixed[n] for n in columns if n in fixed}}
    there = {folded(name): (name, columns) for name, columns in tables_of(connection).items()}
    table, have = there.get(folded(table), (table, None))
    wanted = {name: types[name] for name in columns}
    if have is None:
        listed = ", ".join(f"{quoted(name)} {type_}" for name, type_ in wanted.items())
        connection.execute(f"CREATE TABLE {quoted(table)} ({listed})")
    else:
        wanted = _widened(connection, table, have, wanted)
    casts = ", ".join(
        f"TRY_CAST({quoted(name)} AS {type_}) AS {quoted(name)}" for name, type_ in wanted.items()
    )
    connection.execute(f"INSERT INTO {quoted(table)} BY NAME SELECT {casts} FROM staged")  # noqa: S608


def _found_types(connection: DuckDBPyConnection, columns: Sequence[str]) -> Types:
    found: Types = {}
    for start in range(0, len(columns), _AT_ONCE):
        found.update(_types_of(connection, columns[start : start + _AT_ONCE]))
    return found


def _types_of(connection: DuckDBPyConnection, columns: Sequence[str]) -> Types:
    checks = []
    for name in map(quoted, columns):
        whole = f"coalesce(TRY_CAST({name} AS BIGINT) = TRY_CAST({name} AS DOUBLE), false)"
        checks += [
            f"coalesce(bool_and({name} IS NULL OR ({whole} AND NOT contains({name}, '.'))), true)",
            f"coalesce(bool_and({name} IS NULL OR TRY_CAST({name} AS DOUBLE) IS NOT NULL), true)",
            f"coalesce(bool_and({name} IS NULL OR lower({name}) IN ('true', 'false')), true)",
        ]
    row = connection.execute(f"SELECT {', '.join(checks)} FROM staged").fetchone() or ()  # noqa: S608
    triples = zip(row[0::3], row[1::3], row[2::3], strict=True)
    return {
        name: next(t for t, fits in zip(_FIXED, (*triple, True), strict=True) if fits)
        for name, triple in zip(columns, triples, strict=True)
    }


def wider(one: str, other: str) -> str:
    """The type that can store the values of both types."""
    if one == other:
        return one
    return "DOUBLE" if one in _NUMBERS and other in _NUMBERS else "VARCHAR"


def _widened(
    connection: DuckDBPyConnection, table: str, have: Types, wanted: Mapping[str, str]
) -> Types:
    """Add missing columns and widen types of a table; return the resulting types."""
    columns = {folded(name): name for name in have}
    found: Types = {}
    for name, type_ in wanted.items():
        column = columns.get(folded(name))
        if column is None:
            connection.execute(f"ALTER TABLE {quoted(table)} ADD COLUMN {quoted(name)} {type_}")
            found[name] = type_
            continue
        found[name] = wider(have[column], type_)
        if found[name] != have[column]:
            connection.execute(
                f"ALTER TABLE {quoted(table)} ALTER COLUMN {quoted(column)} TYPE {found[name]}"
            )
    return found
