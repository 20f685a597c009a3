"""Sending contents to S3: measured first, streamed in parts, the same bytes or none.

However large a file is, and however many are sent at once, a thread holds one block of it. What
was sent is what was measured: the digests of the parts, which the server compares, are those of
the bytes that the digest of the whole was made of.
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
"""Largest content that is sent in one piece, least size of the pieces of a larger one [byte]."""
MOST_PARTS = 10_000
"""Of one object, as S3 has it."""
LARGEST = 5 * 2**40
"""Size of an object, as S3 has it [byte]."""
SMALL = 2**20
"""What is no larger is read once, and held while it is sent [byte]."""
CHUNK = 2**20
"""How much of a file is read at once [byte]."""


class ChangedError(Exception):
    """A file is not what it was when it was measured."""


@dataclass(frozen=True)
class Piece:
    """A stretch of a file."""

    begin: int
    size: int
    """[byte]"""
    sha256: str


@dataclass(frozen=True)
class Content:
    """What is to be stored: bytes, or a file that was measured."""

    size: int
    """[byte]"""
    sha256: str
    source: bytes | int
    """The content itself, or the descriptor of its file."""
    pieces: Sequence[Piece] = ()
    """Of a file."""


def of_bytes(content: bytes) -> Content:
    """A content that is at hand."""
    return Content(len(content), hashlib.sha256(content).hexdigest(), content)


def measured(file: BinaryIO) -> Content:
    """The content of an open file as it is now, whatever is appended meanwhile.

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
    """Begin and end of the parts that a file is sent in: of equal size, and not too many."""
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
    """Send a content once.

    Args:
        client: of the server.
        pool: sends the parts of a large file; all files share it.
        bucket: an existing bucket.
        key: name of the object.
        content: what to send.
        headers: of the object.

    Raises:
        ChangedError: the file is not what was measured.
        OSError: the file cannot be read any more.
        MinioException: the server refuses, also urllib3's `HTTPError`.
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
        with suppress(MinioException, HTTPError):  # it is gone, or the server is
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
        body.check()  # then this is why it was refused
        raise
    body.check()
    return etag


class _Bytes(io.BytesIO):
    """A body that is at hand."""

    def __init__(self, content: Content) -> None:
        super().__init__(content.source if isinstance(content.source, bytes) else b"")
        self.size = content.size
        self.sha256 = content.sha256


class _Stretch:
    """A stretch of a file as a body.

    What cannot be read any more is sent as zeros: the server, which was told of a digest, refuses
    them at once, where a body that is too short would let it wait.
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
        """How much was read."""
        return self._position

    def seek(self, position: int, /) -> object:
        """Begin anew: the position is 0."""
        self._position = position
        self._digest = hashlib.sha256()
        return position

    def check(self) -> None:
        """Raise what went wrong with the file when everything was read."""
        if self._failure is not None:
            raise self._failure
        if self._position == self.size and self._digest.hexdigest() != self.sha256:
            raise ChangedError
