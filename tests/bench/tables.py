#!/usr/bin/env python3
"""Why the tables of a campaign are a DuckDB file: beside Parquet, and beside SQLite.

    python tests/bench/tables.py [--runs 2000] [--rows 500] [--repeat 3]

The rows of so many runs are written to each; then a query groups all rows by run, and the rows of
one run are replaced. CPU times, since all three work on one machine at once with others.
"""

from __future__ import annotations

import argparse
import sqlite3
import statistics
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

import duckdb

QUERY = "SELECT run, avg(x) AS m FROM {} GROUP BY run ORDER BY m DESC LIMIT 3"
ONE = "SELECT 7 AS run, i AS stamp, random() AS x, random() AS y, random() AS z FROM range({}) t(i)"
ROWS = (
    "CREATE TABLE poses AS SELECT i // {rows} AS run, i % {rows} AS stamp, random() AS x, "
    "random() AS y, random() AS z FROM range({runs} * {rows}) t(i)"
)


def timed(work: Callable[[], object]) -> float:
    """CPU time [s]."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


class Duck:
    """What is used."""

    def __init__(self, folder: Path, rows: int) -> None:
        self.path, self._rows = folder / "tables.duckdb", rows

    def write(self, source: duckdb.DuckDBPyConnection) -> None:
        self.path.unlink(missing_ok=True)
        source.execute(f"ATTACH '{self.path}' AS d")
        source.execute("CREATE TABLE d.poses AS FROM poses")
        source.execute("DETACH d")

    def ask(self) -> None:
        with closing(duckdb.connect(str(self.path), read_only=True)) as connection:
            connection.execute(QUERY.format("poses")).fetchall()

    def replace(self) -> None:
        with closing(duckdb.connect(str(self.path))) as connection:
            connection.execute("DELETE FROM poses WHERE run = 7")
            connection.execute(f"INSERT INTO poses {ONE.format(self._rows)}")


class Parquet:
    """A file that is written as a whole."""

    def __init__(self, folder: Path, rows: int) -> None:
        self.path, self._rows = folder / "poses.parquet", rows

    def write(self, source: duckdb.DuckDBPyConnection) -> None:
        source.execute(f"COPY poses TO '{self.path}' (FORMAT parquet, COMPRESSION zstd)")

    def ask(self) -> None:
        with closing(duckdb.connect()) as connection:
            connection.execute(QUERY.format(f"'{self.path}'")).fetchall()

    def replace(self) -> None:
        other = self.path.with_suffix(".new")
        rest = f"SELECT * FROM '{self.path}' WHERE run <> 7 UNION ALL {ONE.format(self._rows)}"  # noqa: S608
        with closing(duckdb.connect()) as connection:
            connection.execute(f"COPY ({rest}) TO '{other}' (FORMAT parquet, COMPRESSION zstd)")
        other.replace(self.path)


class Sqlite:
    """By row; what data.db is."""

    def __init__(self, folder: Path, rows: int) -> None:
        self.path, self._rows = folder / "data.db", rows

    def write(self, source: duckdb.DuckDBPyConnection) -> None:
        self.path.unlink(missing_ok=True)
        with closing(sqlite3.connect(self.path)) as connection, connection:
            connection.execute("CREATE TABLE poses (run, stamp, x, y, z)")
            connection.execute("CREATE INDEX by_run ON poses (run)")
            rows = source.execute("FROM poses").fetchall()
            connection.executemany("INSERT INTO poses VALUES (?, ?, ?, ?, ?)", rows)

    def ask(self) -> None:
        with closing(sqlite3.connect(self.path)) as connection:
            connection.execute(QUERY.format("poses")).fetchall()

    def replace(self) -> None:
        row = (7, 1, 0.5, 0.5, 0.5)
        with closing(sqlite3.connect(self.path)) as connection, connection:
            connection.execute("DELETE FROM poses WHERE run = 7")
            connection.executemany("INSERT INTO poses VALUES (?, ?, ?, ?, ?)", [row] * self._rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--rows", type=int, default=500)
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    with TemporaryDirectory() as name, closing(duckdb.connect()) as source:
        source.execute(ROWS.format(runs=arguments.runs, rows=arguments.rows))
        print(f"{arguments.runs} runs with {arguments.rows} rows of 5 columns each, CPU time")
        for kind in (Duck, Parquet, Sqlite):
            store = kind(Path(name), arguments.rows)
            times: dict[str, list[float]] = {"write": [], "query": [], "replace one run": []}
            for _ in range(arguments.repeat):
                times["write"].append(timed(lambda store=store: store.write(source)))
                times["query"].append(timed(store.ask))
                times["replace one run"].append(timed(store.replace))
            shown = ", ".join(f"{what} {statistics.median(t):.3f} s" for what, t in times.items())
            print(f"{kind.__name__}: {shown}, {store.path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
