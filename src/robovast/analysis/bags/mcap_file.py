"""Reads the messages of an MCAP file, even a damaged one.

Records are read sequentially, because a crash leaves no index at the end. A truncated chunk is
decoded as far as possible; a chunk with a wrong checksum is left out.

The records are those of the package `mcap`; its readers take 3.8 s for 200,000 small messages,
which take 0.5 s here, and `rosbags` reads nothing of a file that is cut off.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from struct import Struct
from typing import IO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Schema

from robovast.analysis.bags.definitions import Definition
from robovast.analysis.bags.source import Consumer, Subscribe, Topic, Warn

MAGIC = b"\x89MCAP0\r\n"
_RECORD = Struct("<BQ").unpack_from
_MESSAGE = Struct("<BQHIQ").unpack_from
"""Opcode and length of the record, channel, sequence number, time of receipt [ns]."""
_RECORD_SIZE = 9
_MESSAGE_SIZE = 31
_LARGEST = 1 << 30
"""Largest record [bytes], since records are held in memory."""
_END = (Opcode.DATA_END, Opcode.FOOTER)
_KNOWN = frozenset(Opcode)
_UNREADABLE = (
    struct.error,
    McapError,
    ValueError,
    IndexError,
    KeyError,
    RuntimeError,  # raised by lz4
    zstandard.ZstdError,
)


def read_mcap(file: IO[bytes], name: str, subscribe: Subscribe, warn: Warn) -> None:
    """Pass every message of a file to its topic's consumer.

    Args:
        file: the file, open for reading.
        name: name in warnings.
        subscribe: called once for every channel.
        warn: receives warnings about unreadable data.
    """
    magic = file.read(len(MAGIC))
    if magic != MAGIC:
        warn(f"{name} is not an MCAP file" if magic else f"{name} is empty (0 bytes)")
        return
    _McapFile(file, name, subscribe, warn).read()


class _McapFile:
    def __init__(self, file: IO[bytes], name: str, subscribe: Subscribe, warn: Warn) -> None:
        self.file = file
        self.name = name
        self.subscribe = subscribe
        self.warn = warn
        self.schemas: dict[int, Schema] = {}
        self.consumers: dict[int, Consumer | None] = {}
        self.handlers: dict[int, Callable[[bytes], None]] = {
            Opcode.SCHEMA: lambda content: self.add_schema(Schema.read(_stream(content))),
            Opcode.CHANNEL: lambda content: self.add_channel(Channel.read(_stream(content))),
            Opcode.CHUNK: self.chunk,
        }

    def read(self) -> None:
        """Read all records up to the end of the data."""
        chunks = self.summary() if self.file.seekable() else []
        while True:
            start = self.file.tell()
            head = self.file.read(_RECORD_SIZE)
            if len(head) < _RECORD_SIZE:
                self.warn(f"{self.name} has no end: its recorder was stopped while writing")
                return
            opcode, length = _RECORD(head)
            if opcode in _END:
                return
            if opcode not in _KNOWN or length > _LARGEST:
                following = min((chunk for chunk in chunks if chunk > start), default=None)
                self.lost(start, following)
                if following is None:
                    return
                self.file.seek(following)
                continue
            content = self.file.read(length)
            self.record(opcode, head, content, start)
            if len(content) < length:
                self.warn(f"{self.name} is cut off at byte {start + len(head) + len(content)}")
                return

    def lost(self, start: int, following: int | None) -> None:
        """Warn that a part of the file cannot be read."""
        end = "its end" if following is None else f"byte {following}"
        self.warn(f"{self.name} is damaged: from byte {start} to {end} it cannot be read")

    def summary(self) -> list[int]:
        """Add the channels repeated in the summary; return the start offsets of the chunks."""
        position = self.file.tell()
        self.file.seek(0)
        try:
            summary = make_reader(self.file).get_summary()
        except (*_UNREADABLE, OSError, OverflowError, MemoryError):
            return []
        finally:
            self.file.seek(position)
        if summary is None:
            return []
        for schema in summary.schemas.values():
            self.add_schema(schema)
        for channel in summary.channels.values():
            self.add_channel(channel)
        return [chunk.chunk_start_offset for chunk in summary.chunk_indexes]

    def record(self, opcode: int, head: bytes, content: bytes, start: int) -> None:
        """Process a record, which may be truncated."""
        if opcode == Opcode.MESSAGE:
            self.messages(head + content)
        elif opcode in self.handlers:
            try:
                self.handlers[opcode](content)
            except _UNREADABLE as error:
                self.warn(f"{self.name}: the record at byte {start} is left out: {error}")

    def add_schema(self, schema: Schema) -> None:
        """Store a schema for channels that refer to it."""
        self.schemas[schema.id] = schema

    def add_channel(self, channel: Channel) -> None:
        """Find the consumer of a channel's messages."""
        if channel.id in self.consumers:
            return
        schema = self.schemas.get(channel.schema_id)
        definition = (
            Definition(schema.name, schema.encoding, schema.data.decode())
            if schema
            else Definition("unknown")
        )
        topic = Topic(channel.topic, definition, channel.message_encoding)
        self.consumers[channel.id] = self.subscribe(topic)

    def chunk(self, content: bytes) -> None:
        """Process the messages of a chunk, as far as a truncated chunk goes."""
        chunk = Chunk.read(_stream(content))
        data = _decompress(chunk)
        whole = len(data) == chunk.uncompressed_size
        if whole and chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise ValueError("its checksum is wrong")
        self.messages(data)

    def messages(self, data: bytes) -> None:
        """Process the messages in a sequence of records."""
        offset, end = 0, len(data)
        consumers = self.consumers
        while offset + _RECORD_SIZE <= end:
            opcode, length = _RECORD(data, offset)
            after = offset + _RECORD_SIZE + length
            if after > end:
                return
            if opcode == Opcode.MESSAGE:
                _, _, channel, _, time = _MESSAGE(data, offset)
                consumer = consumers.get(channel)
                if consumer:
                    consumer(time, data[offset + _MESSAGE_SIZE : after])
            elif opcode in self.handlers:
                self.handlers[opcode](data[offset + _RECORD_SIZE : after])
            offset = after


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _decompress(chunk: Chunk) -> bytes:
    if chunk.compression == "zstd":
        return zstandard.ZstdDecompressor().decompressobj().decompress(chunk.data)
    if chunk.compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data))
    if chunk.compression:
        raise ValueError(f"its compression {chunk.compression} is unknown")
    return chunk.data
