"""Feedback and status of an action as two CSV files."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from robovast.bags.job import Context, FileName, Job, nothing_on
from robovast.bags.source import Consumer, Topic
from robovast.bags.topics import MessageTable


class ActionToCsv(Job):
    """Every message on an action's feedback and status topics, with the time of receipt [s]."""

    command = "rosbags_action_to_csv"
    action: str = Field(min_length=1)
    filename_prefix: FileName | None = None

    def start(self, context: Context) -> _ActionWorker:
        """Begin to work on a bag."""
        name = self.action.strip("/")
        prefix = self.filename_prefix or f"action_{name.replace('/', '_')}"
        return _ActionWorker(context, name, prefix)


def _joined(name: str) -> str:
    """`a.b[0].c` as `a_b_0_c`."""
    return name.replace("]", "").replace("[", "_").replace(".", "_")


class _ActionWorker:
    def __init__(self, context: Context, action: str, prefix: str) -> None:
        self._context = context
        self._tables = {
            f"/{action}/_action/{part}": MessageTable(
                context, f"{prefix}_{part}.csv", ["timestamp"], _joined
            )
            for part in ("feedback", "status")
        }

    def subscribe(self, topic: Topic) -> Consumer | None:
        table = self._tables.get(topic.name)
        return table.timed_consumer(topic) if table else None

    def finish(self) -> list[Path]:
        for topic, table in self._tables.items():
            if table.empty:
                self._context.warn(nothing_on(self._context, topic))
        return [table.close() for table in self._tables.values()]

    def discard(self) -> None:
        for table in self._tables.values():
            table.discard()
