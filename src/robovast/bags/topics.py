"""Topics as CSV: every message a row, every field a column."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pydantic import Field, field_validator

from robovast.bags.flatten import Shape, seconds_cell, text_cell
from robovast.bags.job import Context, Job, nothing_on
from robovast.bags.source import Consumer, Topic


class MessageTable:
    """A CSV file of the messages of one topic."""

    def __init__(
        self,
        context: Context,
        name: str,
        leading: list[str],
        title: Callable[[str], str] = str,
    ) -> None:
        self.empty = True
        self._context = context
        self._topics: list[Topic] = []
        self._table = context.table(name, leading, self._columns, title)

    def consumer(self, topic: Topic) -> Consumer:
        """What writes a row with time [ns] and type for each message."""
        add = self._adder(topic)
        kind = text_cell(topic.type.encode())
        return lambda time, data: add(data, [b"%d" % time, kind])

    def timed_consumer(self, topic: Topic) -> Consumer:
        """What writes a row with the time [s] for each message."""
        add = self._adder(topic)
        return lambda time, data: add(data, [seconds_cell(time)])

    def close(self) -> Path:
        """Complete the file."""
        self._table.close()
        return self._table.path

    def discard(self) -> None:
        """Leave nothing behind."""
        self._table.discard()

    def _adder(self, topic: Topic) -> Callable[[bytes, list[bytes]], None]:
        flatten = self._context.flattener(topic)
        if topic not in self._topics:
            self._topics.append(topic)
        variant = self._topics.index(topic)

        def add(data: bytes, cells: list[bytes]) -> None:
            shape = flatten(data, cells)
            self._table.add((variant, shape), cells)
            self.empty = False

        return add

    def _columns(self, key: tuple[int, Shape]) -> list[list[str]]:
        variant, shape = key
        return self._context.columns(self._topics[variant], shape)


class TableWorker:
    """Writes a table for each of some topics; how a message becomes a row, subclasses say."""

    def __init__(self, context: Context, tables: Mapping[str, MessageTable]) -> None:
        self._context = context
        self._tables = tables

    def finish(self) -> list[Path]:
        """The tables; of a topic without messages that is said."""
        for topic, table in self._tables.items():
            if table.empty:
                self._context.warn(nothing_on(self._context, topic))
        return [table.close() for table in self._tables.values()]

    def discard(self) -> None:
        """Leave nothing behind."""
        for table in self._tables.values():
            table.discard()


class TopicsToCsv(Job):
    """Each topic as `<bag>_<topic>.csv`, its slashes as underscores."""

    command = "rosbags_to_csv"
    topics: tuple[str, ...] = Field(min_length=1)

    @field_validator("topics")
    @classmethod
    def _one_file_each(cls, topics: tuple[str, ...]) -> tuple[str, ...]:
        files: dict[str, str] = {}
        for topic in topics:
            other = files.setdefault(_flat(topic), topic)
            if other != topic:
                raise ValueError(f"{other} and {topic} would be written to one file")
        return topics

    def start(self, context: Context) -> _TopicsWorker:
        """Begin to work on a bag."""
        return _TopicsWorker(context, self.topics)


class _TopicsWorker(TableWorker):
    def __init__(self, context: Context, topics: tuple[str, ...]) -> None:
        columns = ["timestamp", "type"]
        names = {topic: f"{topic_file(context, topic)}.csv" for topic in dict.fromkeys(topics)}
        super().__init__(
            context, {topic: MessageTable(context, name, columns) for topic, name in names.items()}
        )

    def subscribe(self, topic: Topic) -> Consumer | None:
        table = self._tables.get(topic.name)
        return table.consumer(topic) if table else None


def topic_file(context: Context, topic: str) -> str:
    """Name of the file of a topic, without its ending."""
    return f"{context.bag.name}_{_flat(topic)}"


def _flat(topic: str) -> str:
    return topic.replace("/", "_")
