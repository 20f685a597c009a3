"""Types shared by the readers of all formats and by those who use them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from robovast.analysis.bags.definitions import Definition

Consumer = Callable[[int, bytes], None]
"""Receives a message: time of receipt [ns], and its bytes in the bag."""

Warn = Callable[[str], None]

Read = tuple[int, int, bytes]
"""A message: time of receipt [ns], number of its channel, content."""

TOGETHER = 1 << 20
"""Size of a block of messages that the file does not group itself [bytes]."""
NEVER = 1 << 63
"""Start of a block without messages [ns]."""
LATEST = (1 << 63) - 1
"""Latest time of a message [ns]; none is negative."""
_MOST_FAULTS = 20


@dataclass(frozen=True)
class Topic:
    """A topic of a bag."""

    name: str
    definition: Definition
    """Serialization of its messages."""
    serialization: str = "cdr"

    @property
    def type(self) -> str:
        """Full name of the message type."""
        return self.definition.type


Subscribe = Callable[[Topic], Consumer | None]
"""Returns the consumer of a topic's messages, or None."""

Types = Mapping[str, str]
"""Type of each topic, by the metadata of the bag."""


@dataclass(slots=True)
class MessageBlock:
    """A part of a file that holds messages and is read at once."""

    place: int
    """Where it begins: a byte, or the row before it."""
    until: int
    """Where it ends: the byte after it, or its last row."""
    size: int
    """[bytes]"""
    start: int = NEVER
    """Time of its first message [ns]"""
    end: int = 0
    """Time of its last message [ns]"""
    channels: set[int] = field(default_factory=set)
    """Channels of its messages."""
    chunk: bool = False
    """True if the file groups the messages."""
    index: int = 0
    """Byte after the file's index of the block; 0 without one."""
    base: int = 0
    """Added to the numbers of its channels, which are those of one recording in the file."""
    count: int = 0
    """Number of its messages."""

    def add(self, channel: int, time: int) -> None:
        """Note a message."""
        time = min(time, LATEST)
        self.start, self.end = min(self.start, time), max(self.end, time)
        self.channels.add(channel)
        self.count += 1

    def cut(self, end: int) -> None:
        """Leave out what is behind a byte of the file."""
        self.until = min(self.until, end)
        self.size = self.until - self.place


class Faults(list[str]):
    """What cannot be read of a file, without duplicates; at most 20 sentences and "and more"."""

    def add(self, text: str) -> None:
        """Note a fault."""
        if text not in self and len(self) <= _MOST_FAULTS:
            more = f"More than {_MOST_FAULTS} parts of a file of the bag cannot be read"
            self.append(more if len(self) == _MOST_FAULTS else text)


class BagFile(Protocol):
    """A file of a bag: where its messages are; they are read when they are needed."""

    topics: dict[int, Topic]
    """By number of the channel."""
    blocks: list[MessageBlock]
    faults: Faults
    complete: bool
    """False if the file has more than may be scanned."""

    def messages(self, block: MessageBlock, channels: Collection[int]) -> list[Read]:
        """Messages of some channels in a block, in recording order."""

    def times(self, block: MessageBlock) -> list[tuple[int, int]]:
        """Channel and time [ns] of the messages in a block."""
