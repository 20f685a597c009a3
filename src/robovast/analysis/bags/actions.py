"""Writes feedback and status of an action to two CSV files."""

from __future__ import annotations

from robovast.analysis.bags.job import Context
from robovast.analysis.bags.source import Consumer, Topic
from robovast.analysis.bags.topics import MessageTable, TableWorker
from robovast.model.document.commands import ActionToCsv, flat


def _joined(name: str) -> str:
    """`a.b[0].c` as `a_b_0_c`."""
    return name.replace("]", "").replace("[", "_").replace(".", "_")


class ActionWorker(TableWorker):
    """Writes all messages on an action's feedback and status topics."""

    def __init__(self, context: Context, job: ActionToCsv) -> None:
        action = job.action.strip("/")
        prefix = job.filename_prefix or f"action_{flat(action)}"
        tables = {
            f"/{action}/_action/{part}": MessageTable(
                context, f"{prefix}_{part}.csv", ["timestamp"], _joined
            )
            for part in ("feedback", "status")
        }
        super().__init__(context, tables)

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of either topic's messages, or None."""
        table = self._tables.get(topic.name)
        return table.timed_consumer(topic) if table else None
