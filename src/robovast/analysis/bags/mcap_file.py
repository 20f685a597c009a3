"""Reads MCAP files, even damaged ones; the only reader of this format.

Heads of all records are scanned first, so an index at the end is not needed: a file whose recorder
was killed has none. Damage costs the damaged record: reading continues at the next record.

The records are those of the package `mcap`; its readers take 3.8 s for 200,000 small messages,
which take 0.5 s here, and `rosbags` reads nothing of a file that is cut off.
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Callable, Collection, Iterator
from functools import partial
from struct import Struct
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.opcode import Opcode

from robovast.analysis.bags.definitions import Definition
from robovast.analysis.bags.source import (
    LATEST,
    NEVER,
    TOGETHER,
    Faults,
    MessageBlock,
    Read,
    Topic,
    Types,
)
from robovast.analysis.bags.zstd import decompressed
from robovast.base.bounds import LARGEST, Bound

MAGIC = b"\x89MCAP0\r\n"
_RECORD = Struct("<BQ")
"""Opcode, length."""
_MESSAGE = Struct("<HIQ")
"""Channel, sequence number, time of receipt [ns]."""
_MESSAGE_SIZE = 22
_HEAD = Struct("<BQHIQ")
"""Opcode and length of a message, and the beginning of its content."""
_CHUNK_HEAD = Struct("<BQQQ")
"""Opcode and length of a chunk, first and last time [ns]."""
_CHUNK = Struct("<QQQII")
"""First and last time [ns], size and checksum of the content, length of the compression's name."""
_INDEX = Struct("<HI")
"""Channel, length of the entries."""
_ENTRY = Struct("<QQ")
"""Time [ns], offset in the chunk."""
_BEGINNING = _RECORD.size + _INDEX.size + _ENTRY.size
"""What the scan reads of each record [bytes]."""
_STATISTICS = Struct("<QHIIIIQQI")
"""Number of messages, seven other numbers, length of the numbers for each channel."""
_LENGTH, _LONG_LENGTH = Struct("<I"), Struct("<Q")
_LEAST: dict[int, int] = {
    Opcode.FOOTER: 20,
    Opcode.SCHEMA: 14,
    Opcode.CHANNEL: 12,
    Opcode.MESSAGE: _MESSAGE_SIZE,
    Opcode.CHUNK: 40,
    Opcode.MESSAGE_INDEX: _INDEX.size,
    Opcode.STATISTICS: _STATISTICS.size,
    Opcode.DATA_END: 4,
}
"""Shortest records [bytes]."""
_MOST: dict[int, int] = {Opcode.FOOTER: 20, Opcode.DATA_END: 4}
"""Longest records [bytes]."""
_IN_BLOCKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.MESSAGE_INDEX)
_NO_END = "has no end: its recorder was stopped while writing"
_PRIVATE = 0x10
"""First opcode that the format does not define."""
_APPLICATION = 0x80
"""First opcode of the records of applications."""
_NEVER = 1 << 64
_LEAST_IN_BLOCK = [
    0 if code >= _APPLICATION else _LEAST[code] if code in _IN_BLOCKS else _NEVER
    for code in range(256)
]
"""Shortest records in a block by opcode [bytes]."""
_CHANNELS = 1 << 16
"""Numbers of channels in a recording."""
_MOST_BLOCKS = 200_000
_FARTHEST = LARGEST + (1 << 20)
"""How far the next record is searched for behind a damaged one [bytes]."""
_WINDOW = 1 << 20
_LIKELY = re.compile(rb"[\x01-\x0f](?=.{4}\0{4})", re.DOTALL)
"""Where a record of less than 4 GiB may begin."""
_ReadAt = Callable[[int, int], bytes]
"""Reads so many bytes at a place."""
_WRONG = (struct.error, ValueError, IndexError, RuntimeError, zstandard.ZstdError)


class McapFile:
    """Where the messages of a file are, by time and channel."""

    def __init__(
        self, open_file: Callable[[], BinaryIO], name: str, types: Types, bound: Bound
    ) -> None:
        """Scan a file.

        Args:
            open_file: opens the file; called again for each block.
            name: name in faults.
            types: types of topics that the file does not describe.
            bound: what the scan may cost.
        """
        self.topics: dict[int, Topic] = {}
        self.blocks: list[MessageBlock] = []
        self.faults = Faults()
        self.complete = True
        self.indexed_chunks = 0
        """Number of chunks in the index at the file's end."""
        self.name = name
        self._open, self._types, self._bound = open_file, types, bound
        self._schemas: dict[int, Definition] = {}
        self._channels: dict[int, tuple[int, str, str]] = {}
        self._base = self._stated = self._part = self._foreign = 0
        """Added to the channels of a recording; number of messages by the summaries; where an
        appended recording begins; where the first record of an application is."""
        with open_file() as file:
            magic = file.read(len(MAGIC))
            if magic != MAGIC:
                self._fault("is not an MCAP file" if magic else "is empty (0 bytes)")
                return
            self._scan(file, os.fstat(file.fileno()).st_size)
            self._complete(file)
        self._compare()
        for number, (schema, topic, encoding) in self._channels.items():
            definition = self._schemas.get(schema) or Definition(types.get(topic, "unknown"))
            self.topics[number] = Topic(topic, definition, encoding)

    def messages(self, block: MessageBlock, channels: Collection[int]) -> list[Read]:
        """Messages of some channels in a block, as far as it can be read."""
        with self._open() as file:
            return self._messages(self._content(file, block), channels, block)

    def times(self, block: MessageBlock) -> list[tuple[int, int]]:
        """Channel and time [ns] of the messages in a block; its index is enough."""
        with self._open() as file:
            if not block.index:
                content = self._content(file, block)
                return [(c, time) for time, c, _ in self._messages(content, self.topics, block)]
            most = min(block.index - block.until, LARGEST)
            index = os.pread(file.fileno(), most, block.until)
        found = []
        for opcode, begin, end in self._records(index, block):
            if opcode == Opcode.MESSAGE_INDEX and end - begin >= _INDEX.size:
                channel, _ = _INDEX.unpack_from(index, begin)
                begin += _INDEX.size
                whole = index[begin : begin + (end - begin) // _ENTRY.size * _ENTRY.size]
                channel += block.base
                entries = _ENTRY.iter_unpack(whole)
                found += [(channel, time) for time, _ in entries if time <= LATEST]
        return found

    def _scan(self, file: BinaryIO, size: int) -> None:
        following: int | None = len(MAGIC)
        while following is not None:
            place = following
            file.seek(place)
            head = file.read(_BEGINNING)
            if head.startswith(MAGIC):
                following = place + len(MAGIC)
                if following == size:
                    return
                continue
            if len(head) < _RECORD.size:
                self._fault(_NO_END)
                self._doubt_index()
                return
            opcode, length = _RECORD.unpack_from(head)
            following = place + _RECORD.size + length
            if self._bound.reached() or len(self.blocks) > _MOST_BLOCKS:
                self._fault(f"has too many records; the records after byte {place} are skipped")
                self.complete = False
                return
            read = partial(os.pread, file.fileno())
            if following > size or _is_damaged(read, opcode, length, place):
                self._doubt_index()
                following = self._after_damage(file, head, place, size)
            else:
                self._add(file, opcode, head, place, following)

    def _after_damage(self, file: BinaryIO, head: bytes, place: int, size: int) -> int | None:
        """Where reading continues after a damaged record; None if nothing follows."""
        read = partial(os.pread, file.fileno())
        opcode, length = _RECORD.unpack_from(head)
        after = place + _RECORD.size + length
        is_cut = opcode == Opcode.CHUNK and _end_of_chunk(read, place) == after
        begin = max(self._part, self.blocks[-1].place if self.blocks else 0) + 1
        following = None if is_cut else _next(read, place + 1, size, self._bound)
        end = place if following is None else following + len(MAGIC)
        appended = _appended(read, begin, size if is_cut else end, self._bound)
        if appended:
            self._fault(f"is cut off at byte {appended}, where another recording begins")
            self._part = appended
            if is_cut and appended > place:
                self._add(file, opcode, head, place, appended)
            elif appended < place and self.blocks:
                self.blocks[-1].cut(appended)
            return appended
        if following is None and after > size and 0 < opcode < _PRIVATE:
            self._fault(_NO_END)
            self._add(file, opcode, head, place, size)
            return None
        self._fault(
            f"is damaged at byte {place}; it cannot be read from there to "
            f"{'its end' if following is None else f'byte {following}'}"
        )
        return following

    def _add(self, file: BinaryIO, opcode: int, head: bytes, place: int, after: int) -> None:
        if opcode == Opcode.MESSAGE and len(head) >= _HEAD.size:
            _, _, channel, _, time = _HEAD.unpack_from(head)
            last = self.blocks[-1] if self.blocks else None
            if last is None or last.chunk or last.until != place or last.size > TOGETHER:
                last = MessageBlock(place, after, 0, base=self._base)
                self.blocks.append(last)
            last.until, last.size = after, after - last.place
            last.add(channel + self._base, time)
        elif opcode == Opcode.CHUNK and len(head) >= _CHUNK_HEAD.size:
            _, _, start, end = _CHUNK_HEAD.unpack_from(head)
            start, end = min(start, LATEST), min(end, LATEST)
            new = MessageBlock(place, after, after - place, start, end, chunk=True, base=self._base)
            self.blocks.append(new)
        elif opcode == Opcode.MESSAGE_INDEX and self.blocks and self.blocks[-1].chunk:
            self._index(self.blocks[-1], head, place, after)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and after - place <= LARGEST:
            begin = place + _RECORD.size
            self._define(opcode, os.pread(file.fileno(), after - begin, begin), self._base)
        else:
            self._note(file, opcode, place, after)

    def _note(self, file: BinaryIO, opcode: int, place: int, after: int) -> None:
        """Add a record that describes the file."""
        if opcode == Opcode.CHUNK_INDEX:
            self.indexed_chunks += 1
        elif opcode == Opcode.STATISTICS and after - place >= _RECORD.size + _STATISTICS.size:
            numbers = os.pread(file.fileno(), _STATISTICS.size, place + _RECORD.size)
            count, *_, rest = _STATISTICS.unpack(numbers)
            if place + _RECORD.size + _STATISTICS.size + rest == after:
                self._stated += count
        elif opcode == Opcode.HEADER and place > len(MAGIC):
            if os.pread(file.fileno(), len(MAGIC), place - len(MAGIC)) != MAGIC:
                return
            self._base += _CHANNELS
            self._fault(f"has another recording appended at byte {place}, which is also read")
        elif _PRIVATE <= opcode < _APPLICATION:
            self._fault(f"has a record of the unknown kind {opcode} at byte {place}")
        elif opcode >= _APPLICATION and after - place >= _HEAD.size:
            self._foreign = self._foreign or place

    def _index(self, chunk: MessageBlock, head: bytes, place: int, after: int) -> None:
        """Add the index of a channel's messages to the chunk in front of it."""
        if len(head) < _RECORD.size + _INDEX.size or place not in (chunk.until, chunk.index):
            self._doubt_index()  # other records lie between the indexes of its channels
            return
        channel, length = _INDEX.unpack_from(head, _RECORD.size)
        if place + _RECORD.size + _INDEX.size + length != after:
            return
        chunk.index = after
        if length:
            chunk.channels.add(channel + chunk.base)
            chunk.count += length // _ENTRY.size
        if length and len(head) == _BEGINNING:
            first, _ = _ENTRY.unpack_from(head, _RECORD.size + _INDEX.size)
            chunk.start = min(chunk.start, first)

    def _compare(self) -> None:
        """Compare what was found with the summary at the end of the file.

        Without statistics, a record of an application may be a damaged message or chunk.
        """
        chunks = sum(block.chunk for block in self.blocks)
        count = sum(block.count for block in self.blocks)
        if self.complete and count < self._stated:
            self._fault(f"has {count} of the {self._stated} messages in its summary")
        if self.complete and chunks < self.indexed_chunks:
            self._fault(f"has {chunks} of the {self.indexed_chunks} chunks in its index")
        if self._foreign and not self._stated:
            self._fault(
                f"has no statistics, and from byte {self._foreign} on records of an application, "
                "which are not read"
            )
        channels = {channel for block in self.blocks for channel in block.channels}
        if self.complete and (lost := channels - self._channels.keys()):
            self._fault(f"does not describe {len(lost)} channels, whose messages are skipped")

    def _complete(self, file: BinaryIO) -> None:
        """Read the channels and correct the times of chunks from their content."""
        for block in self.blocks:
            known = block.channels and block.channels <= self._channels.keys()
            if not block.chunk or (known and 0 < block.start <= block.end):
                continue
            if self._bound.late():
                self._fault("has too many chunks without an index; some channels may be missing")
                self.complete = False
                return
            content = self._content(file, block)
            block.start, block.end, block.count = NEVER, 0, 0
            for opcode, begin, end in self._records(content, block):
                if opcode == Opcode.MESSAGE and end - begin >= _MESSAGE_SIZE:
                    channel, _, time = _MESSAGE.unpack_from(content, begin)
                    block.add(channel + block.base, time)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._define(opcode, content[begin:end], block.base)
                elif opcode >= _APPLICATION and end - begin >= _MESSAGE_SIZE:
                    self._foreign = self._foreign or block.place

    def _doubt_index(self) -> None:
        """Ignore the index of the last chunk, which may not be whole."""
        if self.blocks and self.blocks[-1].chunk:
            self.blocks[-1].index = 0
            self.blocks[-1].channels.clear()

    def _define(self, opcode: int, record: bytes, base: int) -> None:
        """Add a schema or a channel of a recording; the first one of a number counts."""
        try:
            if opcode == Opcode.SCHEMA:
                (number,) = struct.unpack_from("<H", record)
                kind, place = _prefixed(record, 2)
                encoding, place = _prefixed(record, place)
                text, _ = _prefixed(record, place)
                self._schemas.setdefault(base + number, Definition(kind, encoding, text))
            else:
                number, schema = struct.unpack_from("<HH", record)
                topic, place = _prefixed(record, 4)
                encoding, _ = _prefixed(record, place)
                self._channels.setdefault(base + number, (base + schema, topic, encoding))
        except _WRONG as error:
            self._fault(f"has a channel that is skipped: {error}")

    def _content(self, file: BinaryIO, block: MessageBlock) -> bytes:
        """The records of a block; nothing if it cannot be read."""
        try:
            if block.size > LARGEST + _RECORD.size:
                raise ValueError(f"it is larger than {LARGEST} bytes")
            data = os.pread(file.fileno(), block.size, block.place)
            return _unpacked(data) if block.chunk else data
        except _WRONG as error:
            self._fault(f"is damaged: the part at byte {block.place} is skipped: {error}")
            return b""

    def _messages(
        self, content: bytes, channels: Collection[int], block: MessageBlock
    ) -> list[Read]:
        found: list[Read] = []
        base, count = block.base, 0
        for opcode, begin, end in self._records(content, block):
            if opcode == Opcode.MESSAGE and end - begin >= _MESSAGE_SIZE:
                count += 1
                channel, _, time = _MESSAGE.unpack_from(content, begin)
                if time > LATEST:
                    self._fault("has messages with an impossible time, which are skipped")
                elif channel + base in channels:
                    found.append((time, channel + base, content[begin + _MESSAGE_SIZE : end]))
        if content and count < block.count:
            self._fault(
                f"is damaged: the part at byte {block.place} has {count} of {block.count} messages"
            )
        return found

    def _records(self, content: bytes, block: MessageBlock) -> Iterator[tuple[int, int, int]]:
        """Opcode, begin and end of each record in a block."""
        place, size, unpack = 0, len(content), _RECORD.unpack_from
        while place + _RECORD.size <= size:
            opcode, length = unpack(content, place)
            begin = place + _RECORD.size
            place = begin + length
            if place > size or length < _LEAST_IN_BLOCK[opcode]:
                self._fault(f"is damaged: a record in the part at byte {block.place} is skipped")
                start = begin - _RECORD.size + 1
                following = _next(lambda n, at: content[at : at + n], start, size, self._bound)
                if following is None:
                    return
                place = following
                continue
            yield opcode, begin, place

    def _fault(self, text: str) -> None:
        self.faults.add(f"{self.name} {text}")


def _prefixed(record: bytes, place: int) -> tuple[str, int]:
    """Text after its length, and where it ends; bytes that are not UTF-8 become surrogates."""
    (length,) = _LENGTH.unpack_from(record, place)
    end = place + _LENGTH.size + length
    if end > len(record):
        raise ValueError("it is cut off")
    return record[place + _LENGTH.size : end].decode("utf-8", "backslashreplace"), end


def _next(read: _ReadAt, place: int, size: int, bound: Bound) -> int | None:
    """Where the next record begins; None if none is found.

    Args:
        read: reads the file or the block.
        place: where the search begins.
        size: where it ends, at the latest.
        bound: what it may cost.
    """
    for window in range(place, min(size, place + _FARTHEST), _WINDOW):
        for match in _LIKELY.finditer(read(_WINDOW + _RECORD.size - 1, window)):
            if bound.reached():
                return None
            begin = window + match.start()
            after = _end_of(read, begin, size)
            if after and (after == size or _end_of(read, after, size)):
                return begin
    return None


def _is_damaged(read: _ReadAt, opcode: int, length: int, place: int) -> bool:
    """Whether a record is not one of the format or of an application, or a footer within a file."""
    if opcode == Opcode.FOOTER and length == _LEAST[opcode]:
        return not MAGIC.startswith(read(len(MAGIC), place + _RECORD.size + length))
    return opcode < _PRIVATE and not _is_known(opcode, length)


def _is_known(opcode: int, length: int) -> bool:
    """Whether the format defines a record of this length [bytes]."""
    least, most = _LEAST.get(opcode, 0), _MOST.get(opcode, length)
    return 0 < opcode < _PRIVATE and least <= length <= most


def _appended(read: _ReadAt, begin: int, end: int, bound: Bound) -> int | None:
    """Where another recording begins, whose first bytes a record seems to contain."""
    start = MAGIC + bytes([Opcode.HEADER])
    end = min(end, begin + _FARTHEST)
    for window in range(begin, end, _WINDOW):
        if bound.late():
            return None
        place = read(min(_WINDOW + len(start) - 1, end - window), window).find(start)
        if place >= 0:
            return window + place
    return None


def _end_of(read: _ReadAt, place: int, size: int) -> int:
    """The byte after a known record; 0 if there is none."""
    head = read(_RECORD.size, place)
    if len(head) < _RECORD.size:
        return 0
    opcode, length = _RECORD.unpack(head)
    after = place + _RECORD.size + int(length)
    return after if _is_known(opcode, length) and after <= size else 0


def _end_of_chunk(read: _ReadAt, place: int) -> int:
    """The byte after a chunk, by the lengths of its parts; 0 if it is shorter than they are."""
    head = read(_RECORD.size + _CHUNK.size, place)
    if len(head) < _RECORD.size + _CHUNK.size:
        return 0
    place += len(head) + int(_CHUNK.unpack_from(head, _RECORD.size)[4])
    stored = read(_LONG_LENGTH.size, place)
    whole = len(stored) == _LONG_LENGTH.size
    return place + len(stored) + int(_LONG_LENGTH.unpack(stored)[0]) if whole else 0


def _unpacked(record: bytes) -> bytes:
    """The content of a chunk, as far as a chunk that was cut off goes.

    Raises:
        ValueError: it is too large or damaged, or its compression is unknown (also others of
            `_WRONG`).
    """
    _, _, whole, checksum, length = _CHUNK.unpack_from(record, _RECORD.size)
    begin = _RECORD.size + _CHUNK.size
    compression = record[begin : begin + length].decode()
    (stored,) = _LONG_LENGTH.unpack_from(record, begin + length)
    begin += length + _LONG_LENGTH.size
    if whole > LARGEST:
        raise ValueError(f"it is larger than {LARGEST} bytes")
    if compression not in _DECOMPRESS:
        raise ValueError(f"its compression {compression} is unknown")
    content = _DECOMPRESS[compression](record[begin : begin + stored], whole)
    if len(content) > whole:
        raise ValueError("it is larger than its header states")
    if checksum and len(content) == whole and zlib.crc32(content) != checksum:
        raise ValueError("its checksum is wrong")
    return content


def _lz4(data: bytes, most: int) -> bytes:
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, most + 1))


_DECOMPRESS: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda data, _: data,
    "zstd": decompressed,
    "lz4": _lz4,
}
