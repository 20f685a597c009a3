"""Responses of the server: data as JSON, and files in forms that browsers do not execute."""

from __future__ import annotations

import dataclasses
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any, BinaryIO
from urllib.parse import quote

from starlette.responses import JSONResponse, Response, StreamingResponse

_SHOWN = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".gif": "image/gif",
    ".webp": "image/webp",
    ".webm": "video/webm",
    ".mp4": "video/mp4",
}
"""Types that a browser may display; it may only save others."""
_CHUNK = 1 << 18
_RANGE = re.compile(r"bytes=([0-9]*)-([0-9]*)")


class Data(JSONResponse):
    """Dataclasses, lists, dicts and scalars as JSON."""

    def render(self, content: Any) -> bytes:
        """The body."""
        text = json.dumps(content, default=_as_dict, separators=(",", ":"), allow_nan=False)
        return text.encode("utf-8", "replace")


class Attached(Response):
    """A line of JSON, and behind it files one after the other, whose sizes it has."""

    media_type = "application/octet-stream"

    def __init__(self, described: Any, files: Iterable[bytes]) -> None:
        super().__init__(b"".join((Data(described).body, b"\n", *files)))


class Picture(Response):
    """An SVG picture without active content, even when it is opened on its own."""

    media_type = "image/svg+xml"

    def __init__(self, content: str) -> None:
        policy = "default-src 'none'; img-src data:; sandbox"
        super().__init__(content, headers={"content-security-policy": policy})


def _as_dict(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return {
            field.name: getattr(value, field.name)
            for field in dataclasses.fields(value)
            if field.repr
        }
    raise TypeError(f"{type(value).__name__} cannot be converted to JSON")


def send_file(file: BinaryIO, name: str, range_header: str | None) -> Response:
    """Send an open file, or the part that a player requests; closes the file.

    Args:
        file: the file.
        name: name that determines the type and is suggested for saving.
        range_header: the request's `Range`.
    """
    size = os.fstat(file.fileno()).st_size
    media_type = _SHOWN.get(PurePosixPath(name).suffix.lower(), "application/octet-stream")
    kind = "inline" if media_type != "application/octet-stream" else "attachment"
    headers = {
        "accept-ranges": "bytes",
        "content-disposition": f"{kind}; filename*=UTF-8''{quote(name, safe='')}",
        "content-security-policy": "default-src 'none'; sandbox",
    }
    part = _part(range_header, size)
    if part is None:
        file.close()
        return Response(status_code=416, headers={"content-range": f"bytes */{size}"})
    start, end = part
    status = 200
    if (start, end) != (0, size):
        status = 206
        headers["content-range"] = f"bytes {start}-{end - 1}/{size}"
    headers["content-length"] = str(end - start)
    return StreamingResponse(_chunks(file, start, end), status, headers, media_type)


def _part(header: str | None, size: int) -> tuple[int, int] | None:
    """Start and end of the requested part; None if it is not in the file."""
    asked = _RANGE.fullmatch(header or "")
    if asked is None or not any(asked.groups()):
        return 0, size
    first, last = asked.groups()
    start = _offset(first) if first else max(0, size - _offset(last))
    end = min(size, _offset(last) + 1) if first and last else size
    return (start, end) if start < end else None


def _offset(digits: str) -> int:
    """An offset; of more digits than a file's size can have, the first ones count."""
    return int(digits.lstrip("0")[:19] or 0)


def _chunks(file: BinaryIO, start: int, end: int) -> Iterator[bytes]:
    with file:
        file.seek(start)
        while start < end and (chunk := file.read(min(_CHUNK, end - start))):
            start += len(chunk)
            yield chunk


def error(message: str, status: int) -> Response:
    """An error as JSON."""
    content: Mapping[str, str] = {"error": message}
    return Data(content, status)
