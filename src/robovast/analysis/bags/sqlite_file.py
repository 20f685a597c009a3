"""Reads a bag's SQLite files, even damaged ones; the only reader of this format.

`rosbags` refuses a file that is cut off: of one cut at 60 %, all 30,425 messages are read here.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from robovast.analysis.bags.definitions import Definition
from robovast.analysis.bags.source import TOGETHER, Faults, MessageBlock, Read, Topic, Types
from robovast.base.bounds import LARGEST, Bound
from robovast.base.errors import InputError
from robovast.base.sqlite_files import opened, require_tables, tables_of

_MOST_ROWS = 4096
"""Rows of a block."""
_LAST = (1 << 63) - 1
_DAMAGE = {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_TOOBIG}
_MOST_LOSSES = 10_000
"""Rows or pages that may be damaged before the rest is left out."""
_PATIENCE = 64
"""Rows that are skipped one by one before the steps become longer."""


class SqliteFile:
    """Where the messages of a file are, by time and topic."""

    def __init__(self, path: Path, types: Types, bound: Bound) -> None:
        """Scan a file.

        Args:
            path: the file.
            types: types of topics that the file does not describe.
            bound: what the scan may cost.
        """
        self.topics: dict[int, Topic] = {}
        self.blocks: list[MessageBlock] = []
        self.faults = Faults()
        self.complete = True
        self._path = path
        if path.stat().st_size == 0:
            self.faults.add(f"{path.name} is empty (0 bytes)")
            return
        try:
            with opened(path, seconds=bound.seconds_left) as database:
                require_tables(database, path.name, "messages", "topics")
                _require_row_numbers(database, path.name)
                self.topics = dict(_topics(database, types))
                self._scan(database, bound)
        except InputError as error:
            self.faults.add(str(error))

    def messages(self, block: MessageBlock, channels: Collection[int]) -> list[Read]:
        """Messages of some topics in a block, in recording order."""
        wanted = [json.dumps(sorted(channels))]
        where = (
            "AND topic_id IN (SELECT value FROM json_each(?)) AND typeof(data) = 'blob' "
            "AND typeof(timestamp) = 'integer' AND timestamp >= 0 AND typeof(topic_id) = 'integer'"
        )
        found: list[Read] = []
        try:
            with opened(self._path) as database:
                rows = self._rows(database, "timestamp, topic_id, data", block, where, wanted)
                found += ((time, topic, data) for _, time, topic, data in rows)
        except InputError as error:
            self.faults.add(str(error))
        return found

    def times(self, block: MessageBlock) -> list[tuple[int, int]]:
        """Topic and time [ns] of the messages in a block."""
        with opened(self._path) as database:
            rows = self._rows(database, "topic_id, timestamp", block)
            return [
                (topic, time)
                for _, topic, time in rows
                if type(topic) is type(time) is int and time >= 0
            ]

    def _scan(self, database: sqlite3.Connection, bound: Bound) -> None:
        odd, rows = 0, 0
        block = None
        columns = "topic_id, timestamp, typeof(data), length(data)"
        for row, topic, time, kind, size in self._rows(
            database, columns, MessageBlock(-_LAST, _LAST, 0)
        ):
            if bound.reached():
                self.faults.add(f"{self._path.name} has too many rows; the last rows are skipped")
                self.complete = False
                break
            is_message = type(topic) is type(time) is int and time >= 0 and kind == "blob"
            if not is_message or size > LARGEST:
                odd += 1
                continue
            if block is None or rows == _MOST_ROWS or block.size > TOGETHER:
                block, rows = MessageBlock(row - 1, row, 0), 0
                self.blocks.append(block)
            block.until, block.size, rows = row, block.size + size, rows + 1
            block.add(topic, time)
        if odd:
            self.faults.add(
                f"{self._path.name}: {odd} rows are skipped: they do not contain messages"
            )

    def _rows(
        self,
        database: sqlite3.Connection,
        columns: str,
        block: MessageBlock,
        where: str = "",
        wanted: Collection[str] = (),
    ) -> Iterator[tuple[Any, ...]]:
        """Number and columns of the rows of a block, without those that are damaged."""
        after, tries, losses = block.place, 0, 0
        query = (
            f"SELECT rowid, {columns} FROM messages "  # noqa: S608  # constants
            f"WHERE rowid > ? AND rowid <= ? {where} ORDER BY rowid"
        )
        while after < block.until and losses < _MOST_LOSSES:
            try:
                for row in database.execute(query, (after, block.until, *wanted)):
                    if row[0] > after:  # a damaged file may have rows in any order
                        after, tries = row[0], 0
                        yield row
                    elif (losses := losses + 1) > _MOST_LOSSES:
                        return
            except sqlite3.DatabaseError as error:
                if (error.sqlite_errorcode & 0xFF) not in _DAMAGE:
                    raise
                self.faults.add(f"{self._path.name} is damaged: some rows are skipped: {error}")
            else:
                return
            step = after + (1 << tries // _PATIENCE)
            after = max(_following(database, after) or step, step)
            tries, losses = tries + 1, losses + 1


def _require_row_numbers(database: sqlite3.Connection, name: str) -> None:
    """Refuse a table whose `rowid` is not the number of a row.

    Raises:
        InputError: it is a column of its own, or the table has no such numbers.
    """
    columns = database.execute("SELECT lower(name) FROM pragma_table_xinfo('messages')")
    try:
        is_own = ("rowid",) in columns.fetchall()
        database.execute("SELECT rowid FROM messages LIMIT 0")
    except sqlite3.OperationalError:
        is_own = True
    if is_own:
        raise InputError(
            f"{name} is not a valid bag: the rows of its table messages have no numbers."
        )


def _following(database: sqlite3.Connection, row: int) -> int | None:
    """The next row, even if its columns are damaged; None if it cannot be found."""
    try:
        found = database.execute("SELECT min(rowid) FROM messages WHERE rowid > ?", [row])
        return found.fetchone()[0]  # type: ignore[no-any-return]
    except sqlite3.DatabaseError as error:
        if error.sqlite_errorcode == sqlite3.SQLITE_INTERRUPT:
            raise
        return None


def _topics(database: sqlite3.Connection, types: Types) -> Iterator[tuple[int, Topic]]:
    definitions = _definitions(database)
    rows = database.execute("SELECT id, name, type, serialization_format FROM topics")
    for number, name, type_, serialization in rows:
        if type(number) is int:
            kind = str(type_ or types.get(str(name), "unknown"))
            definition = definitions.get(kind) or Definition(kind)
            yield number, Topic(str(name), definition, str(serialization))


def _definitions(database: sqlite3.Connection) -> dict[str, Definition]:
    """Definitions by type; bags before ROS 2 Iron have none."""
    if "message_definitions" not in tables_of(database):
        return {}
    rows = database.execute(
        "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
    )
    return {str(kind): Definition(str(kind), str(how), str(text)) for kind, how, text in rows}
