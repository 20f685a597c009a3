"""The messages of a bag by time, whatever files it consists of."""

from __future__ import annotations

import heapq
import os
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

from robovast.analysis.bags.files import COMPRESSED, PLAIN, read_info
from robovast.analysis.bags.mcap_file import McapFile
from robovast.analysis.bags.order import in_order
from robovast.analysis.bags.source import BagFile, MessageBlock, Topic
from robovast.analysis.bags.sqlite_file import SqliteFile
from robovast.base.bounds import LARGEST, Bound
from robovast.base.errors import InputError
from robovast.evaluation.confined_files import MissingError, open_inside, resolved
from robovast.evaluation.drive.clock import LONGEST_PAUSE, SECOND

_LONG = round(LONGEST_PAUSE * SECOND)
"""[ns]"""
_MOST_LONG = 50
"""Longer blocks that are searched for pauses."""
_MOST_BACK = 4000
"""Messages that are read in search of the one before a moment."""
_MOST_HELD = 4 * LARGEST
"""What is held in memory of the messages of a part, decompressed [bytes]."""


class RecordedMessage(NamedTuple):
    """A message as it was recorded."""

    time: int
    """Time of receipt [ns]"""
    topic: str
    data: bytes


class Recording:
    """A bag; its messages are read when they are asked for."""

    def __init__(self, root: Path, relative: str) -> None:
        """Find out what the files of a bag hold.

        Raises:
            InputError: there is no such folder, or no file in it that can be read.
        """
        folder = resolved(root, relative)
        if not os.path.isdir(folder):
            raise MissingError(f"{relative} is not a folder.")
        self.faults: list[str] = []
        self._too_large: set[str] = set()
        self.files = list(open_files(root, relative))
        self.faults += (
            f"{name} is compressed as a whole, so nothing in it can be found by time; "
            f"decompress it: zstd -d {name}"
            for name in sorted(os.listdir(folder))
            if name.endswith(COMPRESSED)
        )
        blocks = [block for file in self.files for block in file.blocks if block.channels]
        if not blocks:
            reasons = ". ".join(self.all_faults())
            raise InputError(f"{relative} holds no message. {reasons}.".removesuffix(" ."))
        self.start = min(block.start for block in blocks)
        self.end = max(block.end for block in blocks)
        self.topics: dict[str, Topic] = {}
        for file in self.files:
            if file.blocks:
                self.topics.update({topic.name: topic for topic in file.topics.values()})

    def all_faults(self) -> list[str]:
        """What cannot be read, as far as it has been noticed."""
        large = (
            f"The messages near one message on {topic} take more than {_MOST_HELD >> 20} MiB. "
            "Some are skipped."
            for topic in sorted(self._too_large)
        )
        return [*self.faults, *large, *(fault for file in self.files for fault in file.faults)]

    def size(self, topics: Collection[str]) -> int:
        """Bytes that are read for all messages of some topics."""
        return sum(block.size for block in self._with(topics))

    def read(self, topics: Collection[str], start: int, end: int) -> Iterator[RecordedMessage]:
        """Messages of some topics from `start` to before `end` [ns], in order of time."""
        wanted = [_channels(file, topics) for file in self.files]
        for time, number, channel, data in in_order(self.files, wanted, start, end):
            yield RecordedMessage(time, self.files[number].topics[channel].name, data)

    def held(self, topics: Collection[str], start: int, end: int) -> Iterator[RecordedMessage]:
        """The same as `read`, for callers that hold all messages: no more than fit in memory."""
        left = _MOST_HELD
        for message in self.read(topics, start, end):
            left -= len(message.data)
            if left < 0:
                self._too_large.add(message.topic)
                return
            yield message

    def before(self, topic: str, time: int) -> list[RecordedMessage]:
        """Messages of a topic shortly before a time [ns], in order; empty if there is none."""
        moments = [m for m in self.moments(topic) if m < time]
        if not moments:
            return []
        found = self.held([topic], moments[-1], time)
        return heapq.nlargest(_MOST_BACK, found, key=lambda message: message.time)[::-1]

    def moments(self, topic: str) -> list[int]:
        """Times [ns] at or shortly before which there are messages of a topic, in order."""
        return sorted(block.start for block in self._with([topic]))

    def recorded(self) -> list[int]:
        """Times of receipt [ns] at both ends of every long pause, and others."""
        blocks = [(file, block) for file in self.files for block in file.blocks if block.channels]
        long = [(file, block) for file, block in blocks if block.end - block.start > _LONG]
        times = [time for _, block in blocks for time in (block.start, block.end)]
        for file, block in long[:_MOST_LONG]:
            times += (time for _, time in file.times(block))
        return sorted(times)

    def _with(self, topics: Collection[str]) -> Iterator[MessageBlock]:
        for file in self.files:
            wanted = _channels(file, topics)
            yield from (block for block in file.blocks if not wanted.isdisjoint(block.channels))


def open_files(root: Path, relative: str) -> Iterator[BagFile]:
    """The files of a bag that can be read in parts.

    Args:
        root: the results folder, without links.
        relative: the bag's folder in it.
    """
    folder = resolved(root, relative)
    types = read_info(folder, lambda _: None).topics
    for name in sorted(os.listdir(folder)):
        path = f"{relative}/{name}"
        if name.endswith(PLAIN[0]):
            yield McapFile(partial(open_inside, root, path), name, types, Bound())
        elif name.endswith(PLAIN[1]):
            yield SqliteFile(resolved(root, path), types, Bound())


def _channels(file: BagFile, topics: Collection[str]) -> set[int]:
    return {number for number, topic in file.topics.items() if topic.name in topics}
