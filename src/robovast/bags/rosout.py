"""What nodes logged, as one CSV file."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from robovast.bags.flatten import seconds_cell, text_cell
from robovast.bags.job import Context, Job, nothing_on
from robovast.bags.source import Consumer, Topic

ROSOUT = "/rosout"
LEVELS = {"DEBUG": 10, "INFO": 20, "WARN": 30, "ERROR": 40, "FATAL": 50}
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

LevelName = Annotated[
    Literal["DEBUG", "INFO", "WARN", "ERROR", "FATAL"],
    BeforeValidator(lambda name: name.upper() if isinstance(name, str) else name),
]


class RosoutToCsv(Job):
    """Every log message of a level, with the times [s] of receipt and of its own stamp."""

    command = "rosbags_rosout_to_csv"
    min_level: int = Field(default=10, ge=0)
    skip_levels: tuple[LevelName, ...] = ()

    def start(self, context: Context) -> _RosoutWorker:
        """Begin to work on a bag."""
        return _RosoutWorker(context, self.min_level, {LEVELS[name] for name in self.skip_levels})


class _RosoutWorker:
    def __init__(self, context: Context, least: int, skipped: Collection[int]) -> None:
        self._context = context
        self._least = least
        self._skipped = skipped
        self._table = context.table("rosout.csv", _COLUMNS)
        self._seen = False

    def subscribe(self, topic: Topic) -> Consumer | None:
        if topic.name != ROSOUT:
            return None
        read = self._context.reader(topic)
        return lambda time, data: self._log(time, read(data))

    def finish(self) -> list[Path]:
        if not self._seen:
            self._context.warn(nothing_on(self._context, ROSOUT))
        self._table.close()
        return [self._table.path]

    def discard(self) -> None:
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
        """True when a message is of another run that shares the bag."""
        window = self._context.window
        return window is not None and not window[0] <= time <= window[1]
