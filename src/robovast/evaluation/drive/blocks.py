"""Where the messages of an MCAP file are, by time and channel.

Only the heads of records are read, so an index at the end is not needed: a file whose recorder was
killed has none. A block is a chunk, or a sequence of messages outside of chunks.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from struct import Struct
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from robovast.analysis.bags.mcap_file import MAGIC
from robovast.base.errors import InputError
from robovast.evaluation.bounds import Bound, is_record

_RECORD = Struct("<BQ")
"""Opcode, length."""
_MESSAGE = Struct("<HIQ")
"""Channel, sequence number, time of receipt [ns]."""
_MESSAGE_SIZE = 22
_CHUNK = Struct("<QQQII")
"""First and last time [ns], size and checksum of the content, length of the compression's name."""
_INDEX = Struct("<HI")
"""Channel, length of the entries."""
_HEAD = _RECORD.size + 16
_LARGEST = 64 << 20
"""Largest block, compressed or not [bytes]."""
_MOST_BLOCKS = 200_000
_TOGETHER = 1 << 20
"""Size of a block of messages outside of chunks [bytes]."""
_WRONG = (struct.error, McapError, ValueError, IndexError, RuntimeError, zstandard.ZstdError)

Read = tuple[int, int, memoryview]
"""A message: channel, time of receipt [ns], content."""


@dataclass(slots=True)
class Block:
    """A part of a file that holds messages."""

    offset: int
    size: int
    start: int = 1 << 63
    """Time of its first message [ns]"""
    end: int = 0
    """Time of its last message [ns]"""
    channels: set[int] = field(default_factory=set)
    """Empty if unknown: the block may have messages of all channels."""
    chunk: bool = True
    """False for messages outside of chunks."""

    def may_have(self, channels: set[int]) -> bool:
        """Whether it may have messages of one of some channels."""
        return not self.channels or not self.channels.isdisjoint(channels)


class McapBlocks:
    """The blocks of a file, and the channels of their messages."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        self.name = name
        self.blocks: list[Block] = []
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.faults: list[str] = []
        """What cannot be read, and why."""
        descriptor = file.fileno()
        if os.pread(descriptor, len(MAGIC), 0) != MAGIC:
            raise InputError(f"{name} is no MCAP file.")
        bound = Bound()
        self._scan(descriptor, os.fstat(descriptor).st_size, bound)
        self._complete(descriptor, bound)

    def messages(self, file: BinaryIO, block: Block, channels: set[int]) -> Iterator[Read]:
        """The messages of some channels in a block, as far as it can be read."""
        try:
            content = self._content(file.fileno(), block)
        except _WRONG as error:
            self._fault(f"the part at byte {block.offset} is left out: {error}")
            return
        for opcode, body in _records(content):
            if opcode == Opcode.MESSAGE and len(body) >= _MESSAGE_SIZE:
                channel, _, time = _MESSAGE.unpack_from(body)
                if channel in channels:
                    yield channel, time, body[_MESSAGE_SIZE:]

    def _scan(self, descriptor: int, size: int, bound: Bound) -> None:
        place, loose = len(MAGIC), None
        while place + _RECORD.size <= size:
            head = os.pread(descriptor, _HEAD, place)
            opcode, length = _RECORD.unpack_from(head)
            after = place + _RECORD.size + length
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                return
            if fault := self._end_of_scan(opcode, place, bound):
                self._fault(fault)
                return
            if opcode == Opcode.MESSAGE and len(head) == _HEAD:
                loose = self._add_message(loose, head, place, min(after, size))
            elif opcode == Opcode.CHUNK and len(head) == _HEAD:
                times = struct.unpack_from("<QQ", head, _RECORD.size)
                self.blocks.append(Block(place, min(after, size) - place, *times))
            elif opcode == Opcode.MESSAGE_INDEX:
                self._add_index(head)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and length <= _LARGEST:
                self._define(opcode, os.pread(descriptor, length, place + _RECORD.size))
            place = after
        self._fault("it has no end: its recorder was stopped while writing")

    def _end_of_scan(self, opcode: int, place: int, bound: Bound) -> str:
        """Why the file is read no further; empty if it is."""
        if not is_record(opcode):
            return f"it is damaged at byte {place}; the rest is left out"
        if bound.reached() or len(self.blocks) > _MOST_BLOCKS:
            return f"it has too many records; those after byte {place} are left out"
        return ""

    def _add_message(self, loose: Block | None, head: bytes, place: int, after: int) -> Block:
        channel, _, time = _MESSAGE.unpack_from(head, _RECORD.size)
        if loose is None or loose is not self.blocks[-1] or loose.size > _TOGETHER:
            loose = Block(place, 0, chunk=False)
            self.blocks.append(loose)
        loose.size = after - loose.offset
        loose.start, loose.end = min(loose.start, time), max(loose.end, time)
        loose.channels.add(channel)
        return loose

    def _add_index(self, head: bytes) -> None:
        if self.blocks and len(head) >= _RECORD.size + _INDEX.size:
            channel, length = _INDEX.unpack_from(head, _RECORD.size)
            if length:
                self.blocks[-1].channels.add(channel)

    def _complete(self, descriptor: int, bound: Bound) -> None:
        """Find channels that only chunks define, and those of chunks without an index."""
        for block in self.blocks:
            if bound.late():
                self._fault("its channels could not all be searched for in time")
                return
            if block.chunk and (not block.channels or not block.channels <= set(self.channels)):
                try:
                    content = self._content(descriptor, block)
                except _WRONG as error:
                    self._fault(f"the part at byte {block.offset} is left out: {error}")
                    continue
                for opcode, body in _records(content):
                    if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                        self._define(opcode, bytes(body))

    def _define(self, opcode: int, body: bytes) -> None:
        stream = ReadDataStream(BytesIO(body))
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self.schemas[schema.id] = schema
            else:
                channel = Channel.read(stream)
                self.channels[channel.id] = channel
        except _WRONG as error:
            self._fault(f"a channel is left out: {error}")

    def _content(self, descriptor: int, block: Block) -> memoryview:
        """The records of a block.

        Raises:
            ValueError: it is too large, or its compression is unknown (also others of `_WRONG`).
        """
        if block.size > _LARGEST:
            raise ValueError(f"it is larger than {_LARGEST} bytes")
        data = memoryview(os.pread(descriptor, block.size, block.offset))
        if not block.chunk:
            return data
        body = data[_RECORD.size :]
        _, _, whole, checksum, length = _CHUNK.unpack_from(body)
        begin = _CHUNK.size + length
        content = _decompressed(bytes(body[_CHUNK.size : begin]).decode(), body[begin + 8 :])
        if checksum and len(content) == whole and zlib.crc32(content) != checksum:
            raise ValueError("its checksum is wrong")
        return content

    def _fault(self, text: str) -> None:
        told = f"{self.name}: {text}."
        if told not in self.faults and len(self.faults) < 20:
            self.faults.append(told)


def _decompressed(compression: str, data: memoryview) -> memoryview:
    """The content of a chunk, as far as a chunk that was cut off goes."""
    if not compression:
        return data
    if compression not in _DECOMPRESS:
        raise ValueError(f"its compression {compression} is unknown")
    content = _DECOMPRESS[compression](data)
    if len(content) > _LARGEST:
        raise ValueError(f"it is larger than {_LARGEST} bytes")
    return memoryview(content)


def _zstd(data: memoryview) -> bytes:
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        return stream.read(_LARGEST + 1)


def _lz4(data: memoryview) -> bytes:
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, _LARGEST + 1))


_DECOMPRESS: dict[str, Callable[[memoryview], bytes]] = {"zstd": _zstd, "lz4": _lz4}


def _records(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    place, end = 0, len(data)
    while place + _RECORD.size <= end:
        opcode, length = _RECORD.unpack_from(data, place)
        after = place + _RECORD.size + length
        if after > end or not is_record(opcode):
            return
        yield opcode, data[place + _RECORD.size : after]
        place = after
