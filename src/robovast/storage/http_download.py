"""Files from HTTP servers, resumed where an earlier attempt ended.

`urllib3` does not resume, and neither does `pooch`, which would add `requests` (5 MiB).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from urllib3 import BaseHTTPResponse
from urllib3.exceptions import HTTPError

from robovast.base.backoff import TRANSFERRING, Pauses
from robovast.base.errors import StorageError
from robovast.base.file_errors import writing
from robovast.base.sizes import whole_number
from robovast.storage.http_client import CHUNK, HttpClient

_RANGE = re.compile(r"bytes (?P<first>[0-9]{1,18})-[0-9]+/(?P<total>[0-9]{1,18})")
_NO_SUCH_RANGE = 416


def download(
    client: HttpClient,
    url: str,
    dest: Path,
    *,
    attempt: str,
    offset: int = 0,
    headers: Mapping[str, str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Download a file; after an interruption, only the rest is downloaded.

    Args:
        client: client of the server.
        url: URL of the file.
        dest: the local file.
        attempt: the operation, for messages.
        offset: number of bytes that are here already.
        headers: additional headers.
        progress: called with the number of bytes that are here, and of all bytes.

    Raises:
        HttpError: the server refused.
        StorageError: it cannot be reached, or the file cannot be written.
    """
    etag = ""
    with writing(dest), dest.open("r+b" if offset and dest.exists() else "wb") as file:
        transfer = _Transfer(file, progress, offset)
        transfer.start_at(offset)
        while True:
            asked = _range_headers(file.tell(), etag)
            with client.opened(
                "GET",
                url,
                attempt=attempt,
                headers={**(headers or {}), **asked},
                accept={_NO_SUCH_RANGE},
            ) as answer:
                etag = answer.headers.get("ETag", "")
                cause = transfer.receive(answer)
            if cause is None:
                return
            if not transfer.pauses.wait():
                raise StorageError(f"{client.name}: cannot {attempt}: {cause}.")


@dataclass
class _Transfer:
    """A file that arrives, and whether it gets on: only then it has its full patience again."""

    file: IO[bytes]
    progress: Callable[[int, int], None] | None
    farthest: int
    pauses: Pauses = field(default_factory=lambda: Pauses(TRANSFERRING))

    def start_at(self, position: int) -> None:
        """Continue at a position."""
        self.file.seek(position)
        self.file.truncate()

    def receive(self, answer: BaseHTTPResponse) -> object:
        """Write a response; return why the file is not complete, or None."""
        if answer.status == _NO_SUCH_RANGE:  # complete already, or changed
            size = answer.headers.get("Content-Range", "").rpartition("/")[2]
            if whole_number(size) == self.file.tell():
                return None
            self.start_at(0)
            return "the file has changed"
        first, total = _place(answer)
        self.start_at(first)
        try:
            for chunk in answer.stream(CHUNK):
                self.file.write(chunk)
                self._note(self.file.tell(), total)
        except HTTPError as error:
            return error
        arrived = self.file.tell()
        return None if arrived >= total else f"only {arrived} of {total} bytes arrived"

    def _note(self, position: int, total: int) -> None:
        if position > self.farthest:
            self.farthest = position
            self.pauses.reset()
        if self.progress:
            self.progress(position, total)


def _range_headers(offset: int, etag: str) -> dict[str, str]:
    if not offset:
        return {}
    strong = {"If-Range": etag} if etag and not etag.startswith("W/") else {}
    return {"Range": f"bytes={offset}-", **strong}


def _place(answer: BaseHTTPResponse) -> tuple[int, int]:
    """Offset of a response in the file, and the file's size [byte]."""
    match = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
    if answer.status == 206 and match:
        return int(match["first"]), int(match["total"])
    return 0, whole_number(answer.headers.get("Content-Length"))
