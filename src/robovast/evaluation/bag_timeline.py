"""Counts a ROS bag's messages by topic and time.

Only indexes are read and no message is decompressed: a bag of gigabytes takes a second.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from struct import Struct
from typing import BinaryIO

from robovast.base.errors import InputError
from robovast.evaluation.bounds import Bound, is_record
from robovast.evaluation.database import opened, require_tables
from robovast.evaluation.inside import MissingError, open_inside, resolved

BINS = 150
"""Number of intervals into which a bag's time is divided."""

_TICK = 50_000_000
"""Resolution [ns]"""
_MAGIC = b"\x89MCAP0\r\n"
_RECORD = Struct("<BQ")
"""Opcode, length."""
_CHANNEL = Struct("<HHI")
"""Channel, schema, length of the topic's name."""
_MESSAGE = Struct("<HIQ")
"""Channel, sequence number, time [ns]."""
_INDEX = Struct("<HI")
"""Channel, length of the entries."""
_ENTRY = Struct("<QQ")
"""Time [ns], offset in the chunk."""
_IS_CHANNEL, _IS_MESSAGE, _IS_INDEX = 4, 5, 7
_LARGEST = 1 << 26
"""Largest record that is read [bytes]."""

Ticks = Counter[tuple[str, int]]
"""Messages by topic and tick."""


@dataclass(frozen=True)
class Timeline:
    """Messages over time."""

    start: float
    """[s since the epoch]"""
    end: float
    topics: dict[str, list[int]]
    """Number of messages of each topic in each of `BINS` equal intervals."""


def read_timeline(root: Path, relative: str) -> Timeline:
    """The timeline of a bag.

    Raises:
        InputError: there is no such folder below `root`, or its files cannot be read.
    """
    folder = resolved(root, relative)
    if not folder.is_dir():
        raise MissingError(f"{relative} is no folder.")
    ticks: Ticks = Counter()
    for name in sorted(os.listdir(folder)):
        if name.endswith(".mcap"):
            with open_inside(root, f"{relative}/{name}") as file:
                ticks.update(_read_mcap(file, name))
        elif name.endswith(".db3"):
            ticks.update(_read_sqlite(root, f"{relative}/{name}"))
    return _binned(ticks)


def _binned(ticks: Ticks) -> Timeline:
    if not ticks:
        return Timeline(0, 0, {})
    first = min(tick for _, tick in ticks)
    length = max(tick for _, tick in ticks) - first + 1
    topics: dict[str, list[int]] = {}
    for (topic, tick), count in ticks.items():
        topics.setdefault(topic, [0] * BINS)[(tick - first) * BINS // length] += count
    scale = _TICK / 1e9
    return Timeline(first * scale, (first + length) * scale, dict(sorted(topics.items())))


def _read_sqlite(root: Path, relative: str) -> Ticks:
    with opened(root, relative) as connection:
        require_tables(connection, relative, "messages", "topics")
        rows = connection.execute(
            f"SELECT t.name, m.timestamp / {_TICK}, count(*) "  # noqa: S608
            "FROM messages m JOIN topics t ON t.id = m.topic_id "
            "WHERE typeof(m.timestamp) = 'integer' GROUP BY 1, 2"
        )
        return Counter({(str(topic), tick): count for topic, tick, count in rows})


def _read_mcap(file: BinaryIO, name: str) -> Ticks:
    if file.read(len(_MAGIC)) != _MAGIC:
        raise InputError(f"{name} is no MCAP file.")
    topics: dict[int, str] = {}
    ticks: Counter[tuple[int, int]] = Counter()
    for opcode, body in _records(file, name):
        if opcode == _IS_CHANNEL and len(body) >= _CHANNEL.size:
            channel, _, length = _CHANNEL.unpack_from(body)
            text = body[_CHANNEL.size : _CHANNEL.size + length]
            topics[channel] = text.decode("utf-8", "replace")
        elif opcode == _IS_MESSAGE and len(body) >= _MESSAGE.size:
            channel, _, time = _MESSAGE.unpack_from(body)
            ticks[channel, time // _TICK] += 1
        elif opcode == _IS_INDEX and len(body) >= _INDEX.size:
            channel, _ = _INDEX.unpack_from(body)
            entries = memoryview(body)[_INDEX.size :]
            whole = entries[: len(entries) // _ENTRY.size * _ENTRY.size]
            ticks.update((channel, time // _TICK) for time, _ in _ENTRY.iter_unpack(whole))
    return Counter({(topics[c], tick): n for (c, tick), n in ticks.items() if c in topics})


def _records(file: BinaryIO, name: str) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of the records that matter, of messages the beginning alone.

    Raises:
        InputError: there are too many.
    """
    bound = Bound()
    size = os.fstat(file.fileno()).st_size
    place = file.tell()
    while len(header := file.read(_RECORD.size)) == _RECORD.size:
        opcode, length = _RECORD.unpack(header)
        place += _RECORD.size + length
        if place > size or not is_record(opcode):  # the recorder was killed here
            return
        if bound.reached():
            raise InputError(
                f"{name} has too many records to be counted for a timeline. Convert it with "
                "`vast results postprocess`, or record fewer topics."
            )
        if opcode == _IS_MESSAGE:
            yield opcode, file.read(min(length, _MESSAGE.size))
        elif opcode in (_IS_CHANNEL, _IS_INDEX) and length <= _LARGEST:
            yield opcode, file.read(length)
        file.seek(place)
