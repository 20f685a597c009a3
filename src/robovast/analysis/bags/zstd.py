"""Decompresses zstd data of unknown origin, never more than a limit."""

from __future__ import annotations

import os
from pathlib import Path
from shutil import disk_usage
from typing import BinaryIO

import zstandard

from robovast.base.safe_paths import read_at_most

MAGIC = b"\x28\xb5\x2f\xfd"
_HIGHEST_RATIO = 200
"""Most bytes that a byte of a file may stand for, unless they are few."""
_FEW = 256 << 20
_BLOCK = 1 << 20


def decompressed(data: bytes, most: int) -> bytes:
    """The content of a frame, also of one that is cut off.

    Raises:
        ZstdError: the frame is damaged.
        ValueError: the content is larger than `most` bytes.
    """
    size = zstandard.frame_content_size(data)  # negative if the frame does not state it
    limit = most if size < 0 else min(most, size)
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        content = read_at_most(stream, limit + 1)
    if len(content) > limit or size > most:
        raise ValueError(f"it is larger than {limit} bytes")
    return content


def decompress_file(source: BinaryIO, target: Path) -> None:
    """Decompress a file, also one that is cut off, as far as it goes.

    Raises:
        ValueError: it is damaged, or its content is too large; the target has what precedes.
    """
    room = disk_usage(target.parent).free // 2
    most = max(_FEW, os.fstat(source.fileno()).st_size * _HIGHEST_RATIO)
    reader = zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)
    with target.open("wb") as file:
        try:
            while block := reader.read(_BLOCK):
                if file.tell() + len(block) > min(most, room):
                    why = (
                        f"it unpacks to more than {_HIGHEST_RATIO} times its size"
                        if most < room
                        else "the disk has too little free space"
                    )
                    raise ValueError(
                        f"is read only up to {min(most, room) >> 20} MiB of its content: {why}. To "
                        f"read all of a file that you trust, decompress it with `zstd -d`"
                    )
                file.write(block)
        except zstandard.ZstdError as error:
            raise ValueError(f"is damaged: {error}") from None
