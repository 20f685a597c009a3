"""Merges the messages of a bag's files by time."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Iterator, Sequence
from math import inf
from operator import itemgetter

import zstandard

from robovast.analysis.bags import zstd
from robovast.analysis.bags.source import BagFile, MessageBlock, Read
from robovast.base.bounds import LARGEST

_MOST_HELD = 4 * LARGEST
"""Messages that are held until those of overlapping blocks are read [bytes]."""
_JUMP = 1_000_000_000
"""Time by which messages of a topic may be recorded out of order [ns]."""
_LEAST_ROOM = 1 << 30
"""What any file may expand to [bytes]."""
_MOST_EXPANSION = 200
"""Largest ratio of the messages of a larger file to the file."""
_OVERHEAD = 200
"""What a held message takes in addition to its content, about [bytes]."""

Ordered = tuple[int, int, int, bytes]
"""A message: time of receipt [ns], number of its file, number of its channel, content."""


def in_order(
    files: Sequence[BagFile],
    channels: Sequence[Collection[int]],
    start: float = -inf,
    end: float = inf,
) -> Iterator[Ordered]:
    """The messages of some channels of files, in order of time.

    Messages that were compressed one by one are decompressed. What cannot be read is added to the
    faults of its file.

    Args:
        files: the files; of messages of the same time, those of the first file come first.
        channels: numbers of the channels of each file.
        start: time of the first message [ns].
        end: time before which messages end [ns].
    """
    blocks = [
        (block.start, number, block)
        for number, file in enumerate(files)
        for block in file.blocks
        if block.start < end and block.end >= start and channels[number]
    ]
    rooms = [_Room(file) for file in files]
    for file in files:
        _note_jumps(file, ((block.channels, block.start, block.end) for block in file.blocks))
    blocks.sort(key=itemgetter(0))
    horizons = [*(block[0] for block in blocks[1:]), inf]
    held: list[tuple[int, int, int, int, Ordered]] = []
    size = count = 0
    for (_, number, block), horizon in zip(blocks, horizons, strict=False):
        found = rooms[number].take(_messages(files[number], block, channels[number]))
        for time, channel, data in found:
            if not start <= time < end:
                continue
            message = (time, number, channel, data)
            if time >= horizon:
                heapq.heappush(held, (time, number, block.place, count, message))
                size, count = size + len(data) + _OVERHEAD, count + 1
                continue
            while held and held[0][:3] < (time, number, block.place):
                earlier = heapq.heappop(held)[-1]
                size -= len(earlier[3]) + _OVERHEAD
                yield from _plain(files, rooms, earlier)
            if data[:4] == zstd.MAGIC:
                yield from _plain(files, rooms, message)
            else:
                yield message
        while held and (held[0][0] < horizon or size > _MOST_HELD):
            if held[0][0] > horizon:
                files[number].faults.add("Too many messages overlap: some are not in order of time")
            earlier = heapq.heappop(held)[-1]
            size -= len(earlier[3]) + _OVERHEAD
            yield from _plain(files, rooms, earlier)


def _messages(file: BagFile, block: MessageBlock, channels: Collection[int]) -> list[Read]:
    """The messages of a block in order of time; adds faults if their times are odd."""
    recorded = file.messages(block, channels)
    found = sorted(recorded, key=itemgetter(0))
    if recorded != found:
        _note_jumps(file, (((channel,), time, time) for time, channel, _ in recorded))
    if found and not block.start <= found[0][0] <= found[-1][0] <= block.end:
        file.faults.add(
            "Messages are outside of the times that their chunk states: some may be missing or "
            "not in order of time"
        )
    return found


def _note_jumps(file: BagFile, parts: Iterable[tuple[Collection[int], int, int]]) -> None:
    """Add a fault if the times of receipt of a topic jump back.

    Args:
        file: the file.
        parts: channels, first and last time [ns] of parts of it, in recording order.
    """
    latest: dict[int, int] = {}
    for channels, first, last in parts:
        if any(last < latest.get(channel, last) - _JUMP for channel in channels):
            file.faults.add(
                "The times of receipt in a file of the bag jump back, as after a reset of "
                "simulated time. Messages are in order of these times, so parts of the recording "
                "are mixed"
            )
            return
        for channel in channels:
            latest[channel] = max(latest.get(channel, first), first)


class _Room:
    """Bounds what the messages of a file expand to: a few bytes can stand for terabytes."""

    def __init__(self, file: BagFile) -> None:
        self._file = file
        size = sum(block.size for block in file.blocks)
        self._left = max(_LEAST_ROOM, _MOST_EXPANSION * size)

    def take(self, messages: list[Read]) -> list[Read]:
        """Return the messages; none if they are too large together."""
        self._left -= sum(len(data) for *_, data in messages)
        return messages if self.has_some else []

    def grow(self, size: int) -> bool:
        """Count bytes of a decompressed message; return whether it may be used."""
        self._left -= size
        return self.has_some

    @property
    def has_some(self) -> bool:
        """Whether the file may expand further; adds a fault otherwise."""
        if self._left < 0:
            self._file.faults.add(
                "The messages of a file of the bag are far larger than the file: the following "
                "messages are skipped"
            )
        return self._left >= 0


def _plain(files: Sequence[BagFile], rooms: Sequence[_Room], message: Ordered) -> Iterator[Ordered]:
    """A message, decompressed if it is compressed; nothing if it is damaged."""
    time, number, channel, data = message
    if data[:4] != zstd.MAGIC:
        yield message
        return
    try:
        plain = zstd.decompressed(data, LARGEST) if rooms[number].has_some else b""
        if rooms[number].grow(len(plain)):
            yield time, number, channel, plain
    except (zstandard.ZstdError, ValueError) as error:
        topic = files[number].topics[channel].name
        files[number].faults.add(f"a message on {topic} cannot be decompressed: {error}")
