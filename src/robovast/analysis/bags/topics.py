"""Topics as CSV: every message a row, every field a column."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from robovast.analysis.bags.flatten import Shape, seconds_cell, text_cell
from robovast.analysis.bags.job import Context, nothing_on
from robovast.analysis.bags.source import Consumer, Topic
from robovast.analysis.bags.table import written
from robovast.model.document.commands import TopicsToCsv, flat


class MessageTable:
    """A CSV file of the messages of one topic."""

    def __init__(
        self,
        context: Context,
        name: str,
        leading: list[str],
        title: Callable[[str], str] | None = None,
    ) -> None:
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

    @property
    def is_empty(self) -> bool:
        """True when there was no message."""
        return self._table.is_empty

    def written(self) -> list[Path]:
        """The file, complete; none when there was no message."""
        return written(self._table)

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
        """The tables; of a topic without messages there is none, which is said."""
        for topic, table in self._tables.items():
            if table.is_empty:
                self._context.warn(nothing_on(self._context, topic))
        return [path for table in self._tables.values() for path in table.written()]

    def discard(self) -> None:
        """Leave nothing behind."""
        for table in self._tables.values():
            table.discard()


class TopicsWorker(TableWorker):
    """Each topic as `<bag>_<topic>.csv`, its slashes as underscores."""

    def __init__(self, context: Context, job: TopicsToCsv) -> None:
        columns = ["timestamp", "type"]
        names = {topic: f"{topic_file(context, topic)}.csv" for topic in dict.fromkeys(job.topics)}
        super().__init__(
            context, {topic: MessageTable(context, name, columns) for topic, name in names.items()}
        )

    def subscribe(self, topic: Topic) -> Consumer | None:
        """What writes the messages of a topic that is wanted."""
        table = self._tables.get(topic.name)
        return table.consumer(topic) if table else None


def topic_file(context: Context, topic: str) -> str:
    """Name of the file of a topic, without its ending."""
    return f"{context.bag.name}_{flat(topic)}"
