"""Tables that are read in parts, from wherever they are."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import duckdb
import pytest

from robovast.analysis.tables.database import confine
from robovast.analysis.tables.query import ask
from robovast.analysis.tables.stored import StoredTables, reachable
from robovast.base.errors import InputError, StorageError

BY_VERDICT = "SELECT verdict, count(*) FROM runs GROUP BY ALL ORDER BY ALL"
Read = Callable[[int, int], bytes]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """100,000 runs with 40 wide columns."""
    path = tmp_path / "tables.duckdb"
    with duckdb.connect(str(path)) as connection:
        columns = ", ".join(f"hash(i * {n} + 1) AS c{n}" for n in range(40))
        connection.execute(
            f"CREATE TABLE run_records AS SELECT {columns}, i % 3 AS verdict, "  # noqa: S608
            "'c-' || i // 20 AS config, i % 20 AS run FROM range(100000) t(i)"
        )
    return path


def reading(path: Path) -> Read:
    def read(offset: int, length: int) -> bytes:
        with path.open("rb") as stream:
            stream.seek(offset)
            return stream.read(length)

    return read


def test_a_query_reads_the_columns_that_it_needs(file: Path) -> None:
    read, asked = reading(file), []

    def counted(offset: int, length: int) -> bytes:
        asked.append(length)
        return read(offset, length)

    tables = StoredTables("wide", file.stat().st_size, counted)
    assert ask([tables], BY_VERDICT).rows == [(0, 33334), (1, 33333), (2, 33333)]
    assert len(asked) < 20
    assert sum(asked) < tables.size / 10


def test_threads_that_read_side_by_side_get_what_they_asked_for(file: Path) -> None:
    tables = StoredTables("wide", file.stat().st_size, reading(file))
    whole = "SELECT bit_xor(hash(COLUMNS(*))) FROM (SELECT * EXCLUDE campaign FROM runs)"
    with duckdb.connect(str(file), read_only=True) as here:
        expected = here.execute(
            whole.replace(" EXCLUDE campaign", "").replace("runs", "run_records")
        )
        assert ask([tables], whole).rows == expected.fetchall()


def test_a_server_that_fails_is_no_wrong_query(file: Path) -> None:
    read = reading(file)

    def broken(offset: int, length: int) -> bytes:
        if offset > 300_000:
            raise StorageError("the server is gone")
        return read(offset, length)

    with pytest.raises(StorageError, match="the server is gone"):
        ask([StoredTables("wide", file.stat().st_size, broken)], "SELECT sum(c39) FROM runs")


def test_a_query_reaches_no_other_stored_file(file: Path) -> None:
    tables = StoredTables("wide", file.stat().st_size, reading(file))
    for other in ("robovast://other", str(file)):
        with pytest.raises(InputError):
            ask([tables], f"FROM read_csv('{other}')")


def test_threads_end_before_the_connection_closes(file: Path) -> None:
    """Closing it beside threads that have called Python crashes the process now and then."""
    tables = StoredTables("wide", file.stat().st_size, reading(file))
    with duckdb.connect() as connection:
        with reachable(connection, [tables]):
            confine(connection, files=[tables.address])
            connection.execute(f"ATTACH '{tables.address}' AS stored (READ_ONLY)")
            connection.execute("SELECT sum(c1) FROM stored.run_records").fetchall()
        assert connection.execute("SELECT current_setting('threads')").fetchall() == [(1,)]
        with pytest.raises(duckdb.Error, match="locked"):
            connection.execute("SET memory_limit = '9GB'")
