"""Writes topics to CSV files: a row for each message, a column for each field."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from robovast.analysis.bags.flatten import Shape, seconds_cell, text_cell
from robovast.analysis.bags.job import Context, nothing_on
from robovast.analysis.bags.names import undated
from robovast.analysis.bags.source import Consumer, Topic
from robovast.analysis.bags.table import written
from robovast.model.document.commands import TopicsToCsv, flat


class MessageTable:
    """A CSV file with the messages of one topic."""

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
        """A consumer that writes each message with its time [ns] and type."""
        add = self._adder(topic)
        kind = text_cell(topic.type.encode())
        return lambda time, data: add(data, [b"%d" % time, kind])

    def timed_consumer(self, topic: Topic) -> Consumer:
        """A consumer that writes each message with its time [s]."""
        add = self._adder(topic)
        return lambda time, data: add(data, [seconds_cell(time)])

    @property
    def is_empty(self) -> bool:
        """True if there was no message."""
        return self._table.is_empty

    def written(self) -> list[Path]:
        """The complete file; empty if there was no message."""
        return written(self._table)

    def discard(self) -> None:
        """Remove unfinished files."""
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
    """Base class of workers that write a table per topic; subclasses convert messages to rows."""

    def __init__(self, context: Context, tables: Mapping[str, MessageTable]) -> None:
        self._context = context
        self._tables = tables

    def finish(self) -> list[Path]:
        """The tables; warns of topics without messages, which have no table."""
        for topic, table in self._tables.items():
            if table.is_empty:
                self._context.warn(nothing_on(self._context, topic))
        return [path for table in self._tables.values() for path in table.written()]

    def discard(self) -> None:
        """Remove unfinished files."""
        for table in self._tables.values():
            table.discard()


class TopicsWorker(TableWorker):
    """Writes each topic to `<bag>_<topic>.csv`, with slashes as underscores."""

    def __init__(self, context: Context, job: TopicsToCsv) -> None:
        columns = ["timestamp", "type"]
        names = {topic: f"{topic_file(context, topic)}.csv" for topic in dict.fromkeys(job.topics)}
        super().__init__(
            context, {topic: MessageTable(context, name, columns) for topic, name in names.items()}
        )

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of a requested topic, or None."""
        table = self._tables.get(topic.name)
        return table.consumer(topic) if table else None


def topic_file(context: Context, topic: str) -> str:
    """File name of a topic without suffix; the same in all runs, whatever their bags' dates."""
    return f"{undated(context.bag.name)}_{flat(topic)}"
