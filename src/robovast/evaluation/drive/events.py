"""Log messages, and behaviours that change their status."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from robovast.analysis.bags.behaviors import TREE_TYPE
from robovast.analysis.bags.behaviors import status_name as tree_status
from robovast.evaluation.drive.motion import UNDECODABLE, Decoder, stamp_of
from robovast.evaluation.drive.recording import RecordedMessage

MOST_EVENTS = 500
"""Events of one part that are shown."""
_LONGEST = 500
_LEVELS = ((50, "fatal"), (40, "error"), (30, "warn"), (20, "info"))


@dataclass(frozen=True)
class Event:
    """Something that happened."""

    received: int
    """Time of receipt [ns]"""
    stamp: int | None
    """[ns]"""
    kind: Literal["log", "behavior"]
    level: str
    """Of a log message; of a behaviour its new status, in lower case."""
    source: str
    """Node or behaviour."""
    text: str


@dataclass
class Changes:
    """Changes in a behaviour tree."""

    kind: str
    decode: Decoder
    damaged: int = 0

    def events(
        self, before: Iterable[RecordedMessage], messages: Iterable[RecordedMessage]
    ) -> Iterator[Event]:
        """Behaviours that changed their status.

        Args:
            before: messages ahead of the part; they tell the statuses at its beginning.
            messages: messages of the part.
        """
        last: dict[bytes, int] = {}
        if self.kind != TREE_TYPE:
            yield from self._logged(messages)
            return
        for message in before:
            for _ in self._changed(message, last):
                pass
        for message in messages:
            yield from self._changed(message, last)

    def _changed(self, message: RecordedMessage, last: dict[bytes, int]) -> Iterator[Event]:
        try:
            found = [
                (bytes(one.own_id.uuid), int(one.status), str(one.name))
                for one in self.decode(message).behaviours
            ]
        except UNDECODABLE:
            self.damaged += 1
            return
        for number, status, name in found:
            if last.get(number) != status:
                last[number] = status
                text = tree_status(status)
                yield Event(message.time, None, "behavior", text.lower(), name[:_LONGEST], text)

    def _logged(self, messages: Iterable[RecordedMessage]) -> Iterator[Event]:
        for message in messages:
            try:
                changes: list[Any] = self.decode(message).event_log
                found = [(str(c.node_name), str(c.current_status)) for c in changes]
            except UNDECODABLE:
                self.damaged += 1
                continue
            for name, status in found:
                yield Event(
                    message.time,
                    stamp_of(message.data),
                    "behavior",
                    status.lower()[:20],
                    name[:_LONGEST],
                    status[:_LONGEST],
                )


def log_events(messages: Iterable[RecordedMessage], decode: Decoder, level: int) -> Iterator[Event]:
    """Log messages from a level on; messages that cannot be decoded are left out."""
    for message in messages:
        try:
            content = decode(message)
            found = next((name for least, name in _LEVELS if content.level >= least), "debug")
            if content.level < level:
                continue
            yield Event(
                message.time,
                stamp_of(message.data),
                "log",
                found,
                str(content.name)[:_LONGEST],
                str(content.msg)[:_LONGEST],
            )
        except UNDECODABLE:
            continue
