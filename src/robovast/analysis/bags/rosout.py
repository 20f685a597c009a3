"""Writes the log messages of nodes to a CSV file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from robovast.analysis.bags.flatten import seconds_cell, text_cell
from robovast.analysis.bags.job import Context, nothing_on
from robovast.analysis.bags.source import Consumer, Topic
from robovast.model.document.commands import LEVELS, RosoutToCsv

ROSOUT = "/rosout"
_TYPE = "rcl_interfaces/msg/Log"
_NAMES = {level: name.encode() for name, level in LEVELS.items()}
_COLUMNS = (
    "timestamp",
    "stamp",
    "level",
    "level_name",
    "name",
    "msg",
    "file",
    "function",
    "line",
)


class RosoutWorker:
    """Writes log messages of at least a given level."""

    def __init__(self, context: Context, job: RosoutToCsv) -> None:
        self._context = context
        self._least = job.min_level
        self._skipped = {LEVELS[name] for name in job.skip_levels}
        self._table = context.table(job.csv_filename, _COLUMNS)
        self._seen = False

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of the log topic, or None."""
        if topic.name != ROSOUT:
            return None
        if topic.type != _TYPE:
            self._context.warn(f"{ROSOUT} is skipped: its type is {topic.type}, not {_TYPE}")
            return None
        read = self._context.reader(topic)
        return lambda time, data: self._log(time, read(data))

    def finish(self) -> list[Path]:
        """The table, which has no rows if nothing was logged."""
        if not self._seen:
            self._context.warn(nothing_on(self._context, ROSOUT))
        self._table.close()
        return [self._table.path]

    def discard(self) -> None:
        """Remove unfinished files."""
        self._table.discard()

    def _log(self, time: int, log: Any) -> None:
        self._seen = True
        level = int(log.level)
        if level < self._least or level in self._skipped or self._elsewhere(time):
            return
        cells = [
            seconds_cell(time),
            seconds_cell(log.stamp.sec * 1_000_000_000 + log.stamp.nanosec),
            b"%d" % level,
            _NAMES.get(level, b"UNKNOWN"),
            *(text_cell(text.encode()) for text in (log.name, log.msg, log.file, log.function)),
            b"%d" % log.line,
        ]
        self._table.add((), cells)

    def _elsewhere(self, time: int) -> bool:
        """True if a message belongs to another run in the same bag."""
        window = self._context.window
        return window is not None and not window[0] <= time <= window[1]
