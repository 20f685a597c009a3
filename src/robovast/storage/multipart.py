"""Uploads to S3: content is measured first, then streamed in parts, exactly as measured.

Whatever the number and size of files, each thread holds a single block. The server verifies the
digests of the parts, which are computed from the same bytes as the digest of the whole.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from typing import BinaryIO

from minio.error import MinioException, S3Error
from urllib3.exceptions import HTTPError

from robovast.storage.s3_client import Client

PART = 16 * 2**20
"""Largest content sent in one piece, and smallest size of parts of larger ones [byte]."""
MOST_PARTS = 10_000
"""Most parts of an object in S3."""
LARGEST = 5 * 2**40
"""Largest object in S3 [byte]."""
SMALL = 2**20
"""Largest content that is read once and held in memory while it is sent [byte]."""
CHUNK = 2**20
"""Block size for reading files [byte]."""


class ChangedError(Exception):
    """A file has changed since it was measured."""


@dataclass(frozen=True)
class Piece:
    """A range of a file."""

    begin: int
    size: int
    """[byte]"""
    sha256: str


@dataclass(frozen=True)
class Content:
    """Content to store: bytes, or a measured file."""

    size: int
    """[byte]"""
    sha256: str
    source: bytes | int
    """The bytes, or the file descriptor."""
    pieces: Sequence[Piece] = ()
    """The measured ranges of the file."""


def of_bytes(content: bytes) -> Content:
    """Content in memory."""
    return Content(len(content), hashlib.sha256(content).hexdigest(), content)


def measured(file: BinaryIO) -> Content:
    """Measure the current content of an open file; later appends are ignored.

    Raises:
        OSError: it cannot be read, or is larger than S3 allows.
    """
    descriptor = file.fileno()
    size = os.fstat(descriptor).st_size
    if size <= SMALL:
        return of_bytes(os.pread(descriptor, SMALL, 0))
    if size > LARGEST:
        raise OSError(f"it has {size} bytes, and an object in S3 no more than {LARGEST}")
    whole = hashlib.sha256()
    pieces = [_piece(descriptor, begin, end, whole.update) for begin, end in stretches(size)]
    return Content(size, whole.hexdigest(), descriptor, pieces)


def stretches(size: int) -> list[tuple[int, int]]:
    """Start and end of the parts of a file: of equal size, within S3's limit."""
    part = max(PART, -(-size // MOST_PARTS))
    return [(begin, min(begin + part, size)) for begin in range(0, size, part)]


def _piece(descriptor: int, begin: int, end: int, also: Callable[[bytes], None]) -> Piece:
    digest = hashlib.sha256()
    place = begin
    while place < end:
        data = os.pread(descriptor, min(CHUNK, end - place), place)
        if not data:
            raise ChangedError
        digest.update(data)
        also(data)
        place += len(data)
    return Piece(begin, end - begin, digest.hexdigest())


def send(
    client: Client,
    pool: Executor,
    bucket: str,
    key: str,
    content: Content,
    headers: Mapping[str, str],
) -> None:
    """Send content once.

    Args:
        client: client of the server.
        pool: sends the parts of large files; shared by all files.
        bucket: an existing bucket.
        key: the object's key.
        content: the content.
        headers: the object's headers.

    Raises:
        ChangedError: the file has changed since it was measured.
        OSError: the file cannot be read any more.
        MinioException: the server refuses; also urllib3's `HTTPError`.
    """
    headers = {"Content-Type": "application/octet-stream", **headers}
    if isinstance(content.source, bytes):
        client.put(bucket, key, _Bytes(content), headers)
    elif len(content.pieces) == 1:
        _put(client, bucket, key, _Stretch(content.source, content.pieces[0]), headers)
    else:
        _send_parts(client, pool, bucket, key, content, headers)


def _send_parts(
    client: Client,
    pool: Executor,
    bucket: str,
    key: str,
    content: Content,
    headers: Mapping[str, str],
) -> None:
    upload = client.begin(bucket, key, headers)

    def put(number: int, piece: Piece) -> str:
        body = _Stretch(int(content.source), piece)
        query = {"partNumber": str(number), "uploadId": upload}
        return _put(client, bucket, key, body, {}, query)

    tasks = [pool.submit(put, number, piece) for number, piece in enumerate(content.pieces, 1)]
    try:
        client.complete(bucket, key, upload, [task.result() for task in tasks])
    except BaseException:
        for task in tasks:
            task.cancel()
        with suppress(MinioException, HTTPError):  # the upload or the server is gone
            client.abort(bucket, key, upload)
        raise


def _put(
    client: Client,
    bucket: str,
    key: str,
    body: _Stretch,
    headers: Mapping[str, str],
    query: Mapping[str, str] | None = None,
) -> str:
    try:
        etag = client.put(bucket, key, body, headers, query)
    except (S3Error, HTTPError):
        body.check()  # a changed file explains the refusal
        raise
    body.check()
    return etag


class _Bytes(io.BytesIO):
    """A body in memory."""

    def __init__(self, content: Content) -> None:
        super().__init__(content.source if isinstance(content.source, bytes) else b"")
        self.size = content.size
        self.sha256 = content.sha256


class _Stretch:
    """A range of a file as a body.

    Unreadable data is replaced by zeros: the server compares digests and refuses them at once, but
    would wait for the rest of a body that is too short.
    """

    def __init__(self, descriptor: int, piece: Piece) -> None:
        self.size = piece.size
        self.sha256 = piece.sha256
        self._descriptor = descriptor
        self._begin = piece.begin
        self._failure: OSError | None = None
        self.seek(0)

    def read(self, size: int = -1, /) -> bytes:
        """The next bytes."""
        left = self.size - self._position
        wanted = left if size < 0 else min(size, left)
        data = self._pread(wanted)
        self._position += len(data)
        self._digest.update(data)
        return data

    def _pread(self, wanted: int) -> bytes:
        try:
            data = os.pread(self._descriptor, wanted, self._begin + self._position)
        except OSError as error:
            self._failure = error
            data = b""
        return data or bytes(wanted)

    def tell(self) -> int:
        """Current position."""
        return self._position

    def seek(self, position: int, /) -> object:
        """Start again; the position must be 0."""
        self._position = position
        self._digest = hashlib.sha256()
        return position

    def check(self) -> None:
        """Raise the error of the file, once everything was read."""
        if self._failure is not None:
            raise self._failure
        if self._position == self.size and self._digest.hexdigest() != self.sha256:
            raise ChangedError
