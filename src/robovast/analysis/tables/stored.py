"""Tables that DuckDB reads where they are stored, in parts: a query fetches what it needs.

DuckDB's own extension for S3 is not in its package and would have to be downloaded, so reads go
through Python.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from robovast.analysis.tables.database import import_duckdb
from robovast.base.errors import StorageError
from robovast.base.optional_deps import QUERY

if TYPE_CHECKING:
    from duckdb import DuckDBPyConnection

AT_ONCE = 16
"""Parts that are fetched at once: mostly, threads wait."""
_SCHEME = "robovast"


@dataclass(frozen=True)
class StoredTables:
    """A file of tables that is stored elsewhere."""

    campaign: str
    size: int
    """[byte]"""
    read: Callable[[int, int], bytes]
    """Returns the bytes at an offset, of a length; may be called by several threads at once."""
    address: str = field(default_factory=lambda: f"{_SCHEME}://{uuid4().hex}")
    failures: list[StorageError] = field(default_factory=list)
    """Why it could not be read."""


def raise_failure(campaigns: Sequence[Path | StoredTables]) -> None:
    """Raise the error that kept stored tables from being read, if there was one."""
    for tables in campaigns:
        if isinstance(tables, StoredTables) and tables.failures:
            raise tables.failures[0]


@contextmanager
def reachable(
    connection: DuckDBPyConnection, campaigns: Sequence[Path | StoredTables]
) -> Iterator[None]:
    """Make stored tables files for a connection, as long as the context lasts.

    Raises:
        CannotRunError: the extra `query` is not installed completely.
    """
    stored = {item.address: item for item in campaigns if isinstance(item, StoredTables)}
    if not stored:
        yield
        return
    connection.execute("SET allowed_configs = ['threads']")
    connection.execute(f"SET threads = {AT_ONCE}")
    connection.register_filesystem(_file_system(stored))
    try:
        yield
    finally:
        # Closing a connection whose threads have called Python crashes the process now and then
        # (DuckDB 2.0: one of 1,500 queries), so they end first. A damaged file can have made the
        # database invalid, and then it takes no setting.
        with suppress(import_duckdb().Error):
            connection.execute("SET threads = 1")
        connection.unregister_filesystem(_SCHEME)


def _file_system(stored: dict[str, StoredTables]) -> Any:
    """The files as DuckDB asks for them."""
    with QUERY.needed_by("SQL over tables in a bucket"):
        from fsspec import AbstractFileSystem

    class Files(AbstractFileSystem):  # type: ignore[misc]  # it has no types
        protocol = _SCHEME
        cacheable = False

        def open(self, path: str, *_: object, **__: object) -> _File:
            return _File(stored[path])

        def info(self, path: str, **_: object) -> dict[str, object]:
            return {"name": path, "size": stored[path].size, "type": "file"}

        def exists(self, path: str, **_: object) -> bool:
            return path in stored

    return Files()


class _File:
    """An open file; each thread has a position of its own, since DuckDB seeks before each read."""

    def __init__(self, tables: StoredTables) -> None:
        self._tables = tables
        self._own = threading.local()

    def seek(self, offset: int, whence: int = 0) -> int:
        base = {0: 0, 1: self.tell(), 2: self._tables.size}[whence]
        self._own.position = base + offset
        return self.tell()

    def tell(self) -> int:
        return getattr(self._own, "position", 0)

    def read(self, length: int = -1) -> bytes:
        offset = self.tell()
        try:
            content = self._tables.read(offset, self._tables.size if length < 0 else length)
        except StorageError as error:
            self._tables.failures.append(error)
            raise
        self._own.position = offset + len(content)
        return content

    def close(self) -> None: ...
