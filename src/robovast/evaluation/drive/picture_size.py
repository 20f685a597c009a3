"""The size of a picture by its first bytes: few bytes can stand for gigabytes of pixels."""

from __future__ import annotations

import struct
from collections.abc import Callable

_PNG = b"\x89PNG\r\n\x1a\n"
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of JPEG that a size follows."""
_LOW = 0x3FFF
"""The 14 bits of WebP that a length has."""


def size_of(picture: bytes) -> tuple[str, int, int] | None:
    """Media type, width and height; None for what is no JPEG, PNG or WebP."""
    kinds: dict[str, Callable[[bytes], tuple[int, int] | None]] = {
        "image/jpeg": _jpeg,
        "image/png": _png,
        "image/webp": _webp,
    }
    for media_type, read in kinds.items():
        try:
            size = read(picture)
        except (struct.error, IndexError):  # cut off
            continue
        if size is not None:
            return media_type, *size
    return None


def _jpeg(data: bytes) -> tuple[int, int] | None:
    if data[:2] != b"\xff\xd8":
        return None
    at = 2
    while data[at] == 0xFF:
        marker = data[at + 1]
        if marker in _FRAMES:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        # 0xFF may fill the space before a marker
        at += 1 if marker == 0xFF else 2 + struct.unpack_from(">H", data, at + 2)[0]
    return None


def _png(data: bytes) -> tuple[int, int] | None:
    if data[:8] != _PNG or data[12:16] != b"IHDR":
        return None
    width, height = struct.unpack_from(">II", data, 16)
    return width, height


def _webp(data: bytes) -> tuple[int, int] | None:
    if data[:4] != b"RIFF" or data[8:12] != b"WEBP":
        return None
    match data[12:16]:
        case b"VP8 ":
            width, height = struct.unpack_from("<HH", data, 26)
            return width & _LOW, height & _LOW
        case b"VP8L":
            (bits,) = struct.unpack_from("<I", data, 21)
            return (bits & _LOW) + 1, (bits >> 14 & _LOW) + 1
        case b"VP8X":
            width, more, height, most = struct.unpack_from("<HBHB", data, 24)
            return (width | more << 16) + 1, (height | most << 16) + 1
    return None
