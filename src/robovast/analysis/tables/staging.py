"""Loads CSV files into DuckDB: first as text into a table `staged`, then typed into their table.

A column without a known type is a number only if each of its cells can be given back as written,
and if its whole numbers are written in one way: `1` and `2.0` in one column are text.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from robovast.analysis.tables.csv_files import KEYS, folded, read_rows
from robovast.analysis.tables.spelling import (
    LARGEST_EXACT,
    fixed_type,
    is_double,
    is_whole,
    plain,
)

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection

Types = dict[str, str]
"""Columns in order, with their types."""


class TableColumn(NamedTuple):
    """A column of a table."""

    source: str
    """SQL of the table."""
    name: str
    type: str
    plain: bool
    """Whether a `DOUBLE` was written without `.0` where it is whole, as `0` next to `0.5`."""


PLAIN = "whole numbers have no decimal point"
"""Comment on such a column."""
_WHOLE = ("BIGINT", "HUGEINT")
_EXACT = ("BIGINT", "DOUBLE", "DOUBLE", "BOOLEAN")
"""Types to try first; a `DOUBLE` is written with or without `.0`."""
_LONGEST_ROW = 2_000_000
"""DuckDB's default [bytes]; larger values need larger buffers."""
_AT_ONCE = 100
"""Columns that are examined at once; time grows with the square of their number."""


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
    longest = 0
    with path.open("w", encoding="utf-8", newline="") as whole:
        writer = csv.writer(whole)
        writer.writerow(range(len(KEYS) + len(columns)))  # names may have line breaks
        for file in files:
            run = file.relative_to(root).parts[:2]
            for row in read_rows(file, len(columns)):
                longest = max(longest, writer.writerow([*run, *row]))
    stage(connection, [path], [*KEYS, *columns], longest=longest)


def stage(
    connection: DuckDBPyConnection,
    files: Sequence[Path],
    columns: Sequence[str],
    root: Path | None = None,
    *,
    quoted_is_text: bool = False,
    longest: int = 0,
) -> None:
    """Read CSV files as text into the table `staged`.

    Args:
        connection: receives the table.
        files: files with the same header.
        columns: names for the header's cells.
        root: folder of the runs; adds the columns `config` and `run` in front.
        quoted_is_text: whether `""` is a text; otherwise it is NULL, as an empty cell.
        longest: length of the longest row [characters]; rows up to `_LONGEST_ROW` bytes are always
            read.

    Raises:
        duckdb.Error: a file is damaged.
    """
    most_bytes = max(_LONGEST_ROW, 4 * longest)
    cells = {f"c{index}": "VARCHAR" for index in range(len(columns))}
    chosen = [f"{cell} AS {quoted(name)}" for cell, name in zip(cells, columns, strict=True)]
    if root is not None:
        below = f"substr(_file, {len(str(root)) + len(os.sep) + 1})"
        keys = (f"split_part({below}, '/', {n}) AS {key}" for n, key in enumerate(KEYS, 1))
        chosen[:0] = keys
    connection.execute(
        f"CREATE OR REPLACE TEMP TABLE staged AS SELECT {', '.join(chosen)} FROM "  # noqa: S608
        "read_csv($files, columns = $cells, header = true, auto_detect = false, delim = ',', "
        "quote = '\"', escape = '\"', nullstr = '', allow_quoted_nulls = $null, "
        "filename = '_file', max_line_size = $longest, buffer_size = $buffer)",
        {
            "files": list(map(str, files)),
            "cells": cells,
            "null": not quoted_is_text,
            "longest": most_bytes,
            "buffer": max(16 * _LONGEST_ROW, 2 * most_bytes),
        },
    )


def append(
    connection: DuckDBPyConnection, table: str, columns: Sequence[str], fixed: Mapping[str, str]
) -> set[tuple[str, str]]:
    """Append the staged rows to a table; create it, or extend its columns and types, as needed.

    Args:
        connection: connection with the table `staged`.
        table: name of the target table.
        columns: columns of `staged`.
        fixed: known types of columns; others are inferred.

    Returns:
        Table and column, folded, where stored numbers became text that may be written differently
        from the file, such as `5.0` for `5`. These must be read from the files again.
    """
    free = [name for name in columns if name not in fixed]
    types = {**_found_types(connection, free), **fixed}
    there = {folded(name): (name, columns) for name, columns in tables_of(connection).items()}
    table, have = there.get(folded(table), (table, None))
    wanted = {name: types[name] for name in columns}
    plain = _plain_of_staged(connection, [name for name in free if types[name] == "DOUBLE"])
    respelt: set[str] = set()
    if have is None:
        listed = ", ".join(f"{quoted(name)} {type_}" for name, type_ in wanted.items())
        connection.execute(f"CREATE TABLE {quoted(table)} ({listed})")
    else:
        wanted, plain, respelt = _widened(connection, table, have, wanted, plain)
    casts = ", ".join(
        f"TRY_CAST({quoted(name)} AS {type_}) AS {quoted(name)}" for name, type_ in wanted.items()
    )
    connection.execute(f"INSERT INTO {quoted(table)} BY NAME SELECT {casts} FROM staged")  # noqa: S608
    noted = {name for of, name in plain_columns(connection) if of == table}
    for name in noted ^ plain:
        note = literal(PLAIN) if name in plain else "NULL"
        connection.execute(f"COMMENT ON COLUMN {quoted(table)}.{quoted(name)} IS {note}")
    return {(folded(table), name) for name in respelt}


def plain_columns(
    connection: DuckDBPyConnection, catalog: str | None = None
) -> set[tuple[str, str]]:
    """Columns with the comment `PLAIN`, as table and name; see `tables_of`."""
    found = connection.execute(
        "SELECT table_name, column_name FROM duckdb_columns() WHERE comment = $plain "
        "AND database_name = coalesce($catalog, current_database()) AND schema_name = 'main'",
        {"plain": PLAIN, "catalog": catalog},
    )
    return set(found.fetchall())


def _plain_of_staged(connection: DuckDBPyConnection, names: Sequence[str]) -> set[str]:
    """Staged columns of `DOUBLE` whose whole numbers have no decimal point."""
    found: set[str] = set()
    for start in range(0, len(names), _AT_ONCE):
        part = names[start : start + _AT_ONCE]
        row = _one_row(connection, (_has_plain_wholes(quoted(name)) for name in part))
        found.update(name for name, is_plain in zip(part, row, strict=True) if is_plain)
    return found


def _has_plain_wholes(cell: str, yes: str = "") -> str:
    """SQL of whether the whole numbers of a column have no decimal point; with `NOT`, all have."""
    value = f"TRY_CAST({cell} AS DOUBLE)"
    is_fraction = f"NOT isfinite({value}) OR {value} <> trunc({value})"
    is_plain = f"regexp_full_match({cell}, '-?[0-9]+')"
    return f"coalesce(bool_and({is_fraction} OR {yes} {is_plain}), true)"


def _found_types(connection: DuckDBPyConnection, columns: Sequence[str]) -> Types:
    found: Types = {}
    for start in range(0, len(columns), _AT_ONCE):
        found.update(_types_of(connection, columns[start : start + _AT_ONCE]))
    return found


def _types_of(connection: DuckDBPyConnection, columns: Sequence[str]) -> Types:
    checks = [check for name in columns for check in _exact(quoted(name))]
    row = _one_row(connection, checks)
    found = {}
    for place, name in enumerate(columns):
        *exact, is_number = row[5 * place : 5 * place + 5]
        types = [type_ for type_, fits in zip(_EXACT, exact, strict=True) if fits]
        found[name] = types[0] if types else "VARCHAR"
        if not types and is_number:
            found[name] = _number_type(connection, quoted(name))
    return found


def _exact(cell: str) -> Iterator[str]:
    """SQL conditions: a column is of each of the types `_EXACT`, and all cells may be numbers."""
    whole, value = f"TRY_CAST({cell} AS BIGINT)", f"TRY_CAST({cell} AS DOUBLE)"
    yield f"coalesce(bool_and({whole}::VARCHAR IS NOT DISTINCT FROM {cell}), true)"
    yield f"bool_and({cell} IS NULL OR coalesce({value}::VARCHAR = {cell}, false))"
    yield f"bool_and({cell} IS NULL OR coalesce({plain(value)} = {cell}, false))"
    yield f"bool_and({cell} IN ('true', 'false')) OR bool_and({cell} IN ('True', 'False'))"
    yield f"bool_and({cell} IS NULL OR {value} IS NOT NULL)"


def _number_type(connection: DuckDBPyConnection, cell: str) -> str:
    """The type of a column whose numbers are written in other ways than the shortest."""
    whole = f"bool_and({cell} IS NULL OR {is_whole(cell)})"
    is_hugeint, fixed = _one_row(connection, (whole, fixed_type(cell)))
    if is_hugeint or fixed:
        return fixed or "HUGEINT"
    double = f"bool_and({cell} IS NULL OR {is_double(cell)})"
    differ = f"count(DISTINCT {cell}) = count(DISTINCT TRY_CAST({cell} AS DOUBLE))"
    alike = f"{_has_plain_wholes(cell)} OR {_has_plain_wholes(cell, 'NOT')}"
    is_number = all(_one_row(connection, (check,))[0] for check in (double, differ, alike))
    return "DOUBLE" if is_number else "VARCHAR"


def _one_row(connection: DuckDBPyConnection, checks: Iterable[str]) -> tuple[Any, ...]:
    return connection.execute(f"SELECT {', '.join(checks)} FROM staged").fetchone() or ()  # noqa: S608


def wider(one: str, other: str) -> str:
    """The type that can store the values of both types."""
    if one == other:
        return one
    if one in _WHOLE and other in _WHOLE:
        return "HUGEINT"
    return "DOUBLE" if {one, other} == {"BIGINT", "DOUBLE"} else "VARCHAR"


def _widened(
    connection: DuckDBPyConnection,
    table: str,
    have: Types,
    wanted: Mapping[str, str],
    plain: set[str],
) -> tuple[Types, set[str], set[str]]:
    """Add missing columns and widen types of a table.

    Returns:
        The resulting types, the table's plain columns, and the folded columns whose numbers may be
        written differently.
    """
    noted = {name for of, name in plain_columns(connection) if of == table}
    columns = {folded(name): name for name in have}
    found: Types = {}
    respelt = set()
    for name, type_ in wanted.items():
        column = columns.get(folded(name))
        if column is None:
            connection.execute(f"ALTER TABLE {quoted(table)} ADD COLUMN {quoted(name)} {type_}")
            found[name] = type_
            noted |= plain & {name}
            continue
        before = have[column]
        pair = (
            TableColumn(quoted(table), column, before, column in noted),
            TableColumn("staged", name, type_, name in plain),
        )
        found[name] = joint_type(connection, pair)
        is_plain = found[name] == "DOUBLE" and all(map(_is_plain, pair))
        (noted.add if is_plain else noted.discard)(column)
        if found[name] != before:
            connection.execute(
                f"ALTER TABLE {quoted(table)} ALTER COLUMN {quoted(column)} TYPE {found[name]}"
            )
            if found[name] == "VARCHAR" and (before not in _WHOLE or type_ == "DOUBLE"):
                respelt.add(folded(name))
    return found, noted, respelt


def joint_type(
    connection: DuckDBPyConnection, columns: Sequence[TableColumn], *, spelt: bool = True
) -> str:
    """The type that keeps different values of several columns different.

    Args:
        connection: connection to the tables.
        columns: the columns, all with values of one meaning.
        spelt: whether a whole number and an equal `DOUBLE` are different, as `1` and `1.0`.
    """
    types = {column.type for column in columns}
    if len(types) > 1:
        largest = [_largest(connection, column) for column in columns]
        columns = [c for c, number in zip(columns, largest, strict=True) if number is not None]
        types = {column.type for column in columns} or types
        joint = reduce(wider, sorted(types))
        if (
            joint == "DOUBLE"
            and len(types) > 1
            and max(map(int, filter(None, largest)), default=0) > LARGEST_EXACT
        ):
            return "VARCHAR"
    else:
        (joint,) = types
    if spelt and joint == "DOUBLE" and len({_is_plain(column) for column in columns}) > 1:
        plain, others = ([c for c in columns if _is_plain(c) is one] for one in (True, False))
        return "VARCHAR" if _share_wholes(connection, plain, others) else joint
    return joint


def _is_plain(column: TableColumn) -> bool:
    return column.plain or column.type in _WHOLE


def _largest(connection: DuckDBPyConnection, column: TableColumn) -> int | None:
    """The largest absolute value of a column of whole numbers, 0 for others; None without value."""
    if column.type not in _WHOLE:
        return 0
    found = connection.execute(
        f"SELECT max(abs({quoted(column.name)}::HUGEINT)) FROM {column.source}"  # noqa: S608
    ).fetchone()
    return found[0] if found else None


def _share_wholes(
    connection: DuckDBPyConnection, some: Sequence[TableColumn], others: Sequence[TableColumn]
) -> bool:
    """Whether a whole number of some columns is one of others."""
    one, other = (
        " UNION ALL ".join(
            f"SELECT {quoted(name)}::DOUBLE AS x FROM {source}"  # noqa: S608
            for source, name, *_ in columns
        )
        for columns in (some, others)
    )
    found = connection.execute(
        f"SELECT 1 FROM (({one}) INTERSECT ({other})) WHERE x = trunc(x) LIMIT 1"  # noqa: S608
    )
    return found.fetchone() is not None
