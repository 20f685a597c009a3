"""Writes the status changes of a tree's behaviours to a CSV file."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from uuid import UUID

from robovast.analysis.bags.flatten import seconds_cell, text_cell
from robovast.analysis.bags.job import Context, nothing_on
from robovast.analysis.bags.source import Consumer, Topic
from robovast.analysis.bags.table import written
from robovast.model.document.commands import BehaviorsToCsv

TREE_TYPE = "py_trees_ros_interfaces/msg/BehaviourTree"
_COLUMNS = ("timestamp", "behavior_name", "behavior_id", "status", "status_name", "class_name")
_STATUS = {1: "INVALID", 2: "RUNNING", 3: "SUCCESS", 4: "FAILURE"}


def status_name(status: int) -> str:
    """Name of a behaviour's status."""
    return _STATUS.get(status, "UNKNOWN")


class BehaviorsWorker:
    """Writes a row whenever a behaviour's status changes."""

    def __init__(self, context: Context, job: BehaviorsToCsv) -> None:
        self._context = context
        self._table = context.table(job.csv_filename, _COLUMNS)
        self._last: dict[UUID, int] = {}
        self._seen = False

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of a topic of behaviour trees, or None."""
        if topic.type != TREE_TYPE:
            return None
        read = self._context.reader(topic)
        return lambda time, data: self._tree(time, read(data))

    def finish(self) -> list[Path]:
        """The table; empty if no behaviour was recorded."""
        if not self._seen:
            self._context.warn(nothing_on(self._context, f"a topic of type {TREE_TYPE}"))
        return written(self._table)

    def discard(self) -> None:
        """Remove unfinished files."""
        self._table.discard()

    def _tree(self, time: int, tree: Any) -> None:
        self._seen = True
        for behavior in tree.behaviours:
            number, status = UUID(bytes=bytes(behavior.own_id.uuid)), int(behavior.status)
            if self._last.get(number) == status:
                continue
            self._last[number] = status
            cells = [
                seconds_cell(time),
                text_cell(behavior.name.encode()),
                str(number).encode(),
                b"%d" % status,
                status_name(status).encode(),
                text_cell(behavior.class_name.encode()),
            ]
            self._table.add((), cells)
