"""Feedback and status of an action as two CSV files."""

from __future__ import annotations

from pydantic import Field

from robovast.bags.job import Context, FileName, Job
from robovast.bags.source import Consumer, Topic
from robovast.bags.topics import MessageTable, TableWorker


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


class _ActionWorker(TableWorker):
    def __init__(self, context: Context, action: str, prefix: str) -> None:
        tables = {
            f"/{action}/_action/{part}": MessageTable(
                context, f"{prefix}_{part}.csv", ["timestamp"], _joined
            )
            for part in ("feedback", "status")
        }
        super().__init__(context, tables)

    def subscribe(self, topic: Topic) -> Consumer | None:
        table = self._tables.get(topic.name)
        return table.timed_consumer(topic) if table else None
