"""The messages of a bag by time, whatever files it consists of."""

from __future__ import annotations

import heapq
import os
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

from robovast.analysis.bags.definitions import Definition
from robovast.analysis.bags.sqlite_file import read_definitions
from robovast.base.errors import InputError
from robovast.evaluation.database import opened, require_tables
from robovast.evaluation.drive.blocks import Block, McapBlocks
from robovast.evaluation.drive.clock import LONGEST_PAUSE, SECOND
from robovast.evaluation.inside import MissingError, open_inside, resolved

_LONG = round(LONGEST_PAUSE * SECOND)
"""[ns]"""
_MOST_LONG = 50
"""Longer blocks that are searched for pauses."""
_MOST_BACK = 4000
"""Messages that are read in search of the one before a moment."""


class Message(NamedTuple):
    """A message as it was recorded."""

    time: int
    """Time of receipt [ns]"""
    topic: str
    data: bytes


@dataclass(frozen=True)
class Topic:
    """A topic of a recording."""

    definition: Definition
    serialization: str = "cdr"

    @property
    def type(self) -> str:
        """Full name of its message type."""
        return self.definition.type


class _Store(Protocol):
    """One file of a bag."""

    topics: dict[str, Topic]
    start: int
    end: int

    def faults(self) -> list[str]:
        """What cannot be read."""

    def size(self, topics: Collection[str]) -> int:
        """Bytes that are read for all messages of some topics."""

    def read(self, topics: Collection[str], start: int, end: int) -> Iterator[Message]:
        """Messages of some topics from `start` to before `end` [ns], roughly by time."""

    def moments(self, topic: str) -> list[int]:
        """Times [ns] at or shortly before which there are messages of a topic, in order."""

    def recorded(self) -> Iterator[int]:
        """Times of receipt [ns] at both ends of every long pause, and others."""


class Recording:
    """A bag; its messages are read when they are asked for."""

    def __init__(self, root: Path, relative: str) -> None:
        """Find out what the files of a bag hold.

        Raises:
            InputError: there is no such folder, or no file in it that can be read.
        """
        folder = resolved(root, relative)
        if not folder.is_dir():
            raise MissingError(f"{relative} is no folder.")
        self.faults: list[str] = []
        self._stores: list[_Store] = []
        for name in sorted(os.listdir(folder)):
            try:
                if name.endswith(".mcap"):
                    self._stores.append(_McapStore(root, f"{relative}/{name}"))
                elif name.endswith(".db3"):
                    self._stores.append(_SqliteStore(root, f"{relative}/{name}"))
                elif name.endswith((".mcap.zstd", ".db3.zstd")):
                    self.faults.append(
                        f"{name} is compressed as a whole, so nothing in it can be found by time; "
                        f"decompress it: zstd -d {name}"
                    )
            except InputError as error:
                self.faults.append(str(error))
        used = [store for store in self._stores if store.start <= store.end]
        if not used:
            reasons = " ".join([*self.faults, *self._damage()])
            raise InputError(f"{relative} holds no message. {reasons}".strip())
        self.start = min(store.start for store in used)
        self.end = max(store.end for store in used)
        self.topics: dict[str, Topic] = {}
        for store in used:
            self.topics.update(store.topics)

    def all_faults(self) -> list[str]:
        """What cannot be read, as far as it has been noticed."""
        return [*self.faults, *self._damage()]

    def size(self, topics: Collection[str]) -> int:
        """Bytes that are read for all messages of some topics."""
        return sum(store.size(topics) for store in self._stores)

    def read(self, topics: Collection[str], start: int, end: int) -> Iterator[Message]:
        """Messages of some topics from `start` to before `end` [ns]."""
        for store in self._stores:
            if store.start < end and store.end >= start:
                yield from store.read(topics, start, end)

    def before(self, topic: str, time: int) -> list[Message]:
        """Messages of a topic shortly before a time [ns], in order; empty if there is none."""
        moments = [m for m in self.moments(topic) if m < time]
        if not moments:
            return []
        found = self.read([topic], moments[-1], time)
        return heapq.nlargest(_MOST_BACK, found, key=lambda message: message.time)[::-1]

    def moments(self, topic: str) -> list[int]:
        """Times [ns] at or shortly before which there are messages of a topic, in order."""
        return sorted(moment for store in self._stores for moment in store.moments(topic))

    def recorded(self) -> list[int]:
        """Times of receipt [ns] at both ends of every long pause, and others."""
        return sorted(time for store in self._stores for time in store.recorded())

    def _damage(self) -> list[str]:
        return [fault for store in self._stores for fault in store.faults()]


class _McapStore:
    def __init__(self, root: Path, relative: str) -> None:
        self._root, self._relative = root, relative
        with open_inside(root, relative) as file:
            self._index = McapBlocks(file, relative.rpartition("/")[2])
        self._numbers: dict[str, set[int]] = {}
        self.topics: dict[str, Topic] = {}
        for number, channel in self._index.channels.items():
            schema = self._index.schemas.get(channel.schema_id)
            text = schema.data.decode("utf-8", "replace") if schema else ""
            definition = Definition(
                schema.name if schema else "unknown", schema.encoding if schema else "", text
            )
            self._numbers.setdefault(channel.topic, set()).add(number)
            self.topics[channel.topic] = Topic(definition, channel.message_encoding)
        blocks = self._blocks = [b for b in self._index.blocks if b.start <= b.end]
        self.start = min((block.start for block in blocks), default=1)
        self.end = max((block.end for block in blocks), default=0)

    def faults(self) -> list[str]:
        return self._index.faults

    def size(self, topics: Collection[str]) -> int:
        return sum(block.size for block in self._with(topics))

    def read(self, topics: Collection[str], start: int, end: int) -> Iterator[Message]:
        wanted = {number for topic in topics for number in self._numbers.get(topic, ())}
        names = {number: self._index.channels[number].topic for number in wanted}
        with ExitStack() as stack:
            file = None
            for block in self._with(topics):
                if block.start >= end or block.end < start:
                    continue
                file = file or stack.enter_context(open_inside(self._root, self._relative))
                for number, time, data in self._index.messages(file, block, wanted):
                    if start <= time < end:
                        yield Message(time, names[number], bytes(data))

    def moments(self, topic: str) -> list[int]:
        return [block.start for block in self._with([topic])]

    def recorded(self) -> Iterator[int]:
        long = [block for block in self._blocks if block.end - block.start > _LONG]
        yield from (time for block in self._blocks for time in (block.start, block.end))
        with open_inside(self._root, self._relative) as file:
            for block in long[:_MOST_LONG]:
                every = set(self._index.channels)
                yield from (time for _, time, _ in self._index.messages(file, block, every))

    def _with(self, topics: Collection[str]) -> Iterator[Block]:
        wanted = {number for topic in topics for number in self._numbers.get(topic, ())}
        return (block for block in self._blocks if wanted and block.may_have(wanted))


class _SqliteStore:
    def __init__(self, root: Path, relative: str) -> None:
        self._root, self._relative = root, relative
        with opened(root, relative) as connection:
            require_tables(connection, relative, "messages", "topics")
            first, last = connection.execute(
                "SELECT min(timestamp), max(timestamp) FROM messages "
                "WHERE typeof(timestamp) = 'integer'"
            ).fetchone()
            rows = connection.execute(
                "SELECT id, name, type, serialization_format FROM topics "
                "WHERE typeof(id) = 'integer'"
            )
            described = rows.fetchall()
            definitions = read_definitions(connection)
        self._numbers = {str(name): int(number) for number, name, _, _ in described}
        self.topics = {
            str(name): Topic(definitions.get(kind, Definition(str(kind))), str(how))
            for _, name, kind, how in described
        }
        self.start: int = 1 if first is None else first
        self.end: int = 0 if last is None else last

    def faults(self) -> list[str]:
        return []

    def size(self, topics: Collection[str]) -> int:
        del topics
        return resolved(self._root, self._relative).stat().st_size

    def read(self, topics: Collection[str], start: int, end: int) -> Iterator[Message]:
        names = {self._numbers[topic]: topic for topic in topics if topic in self._numbers}
        numbers = ",".join(map(str, names))
        with opened(self._root, self._relative) as connection:
            rows = connection.execute(
                "SELECT topic_id, timestamp, data FROM messages "  # noqa: S608  # numbers
                f"WHERE timestamp >= ? AND timestamp < ? AND topic_id IN ({numbers}) "
                "AND typeof(timestamp) = 'integer' ORDER BY timestamp",
                (start, end),
            )
            for number, time, data in rows:
                if isinstance(data, bytes):
                    yield Message(time, names[number], data)

    def moments(self, topic: str) -> list[int]:
        if topic not in self._numbers:
            return []
        with opened(self._root, self._relative) as connection:
            rows = connection.execute(
                "SELECT min(timestamp) FROM messages WHERE topic_id = ? AND timestamp >= 0 "
                "AND typeof(timestamp) = 'integer' "
                "GROUP BY timestamp / ?",
                (self._numbers[topic], max(1, (self.end - self.start) // 200)),
            )
            return [moment for (moment,) in rows]

    def recorded(self) -> Iterator[int]:
        with opened(self._root, self._relative) as connection:
            rows = connection.execute(
                "SELECT min(timestamp), max(timestamp) FROM messages "
                "WHERE typeof(timestamp) = 'integer' GROUP BY timestamp / ?",
                (_LONG,),
            )
            for ends in rows:
                yield from ends
