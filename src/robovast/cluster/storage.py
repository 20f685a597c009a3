"""An S3 server as RoboVAST uses it: patient, checksummed, and never the same work twice.

Every object carries the SHA-256 of its content. Writing is idempotent: what is there and equal is
not sent again. A server that is restarted, or gone for a while, costs time and nothing else.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, TypeVar, cast

import urllib3
from minio.deleteobjects import DeleteObject
from minio.error import MinioException, S3Error
from urllib3.exceptions import HTTPError, ProtocolError

from robovast.atomic import put_in_place
from robovast.cluster.endpoint import Credentials, Endpoint
from robovast.cluster.faults import explained, passes, persist
from robovast.cluster.s3_client import CreateOnly, connect
from robovast.errors import StorageError
from robovast.pauses import Pauses

T = TypeVar("T")

DIGEST = "sha256"
"""Metadata key of the content's SHA-256, in hexadecimal digits."""
MODE = "mode"
"""Metadata key that executable files have."""
EXECUTABLE = 0o755

PART = 16 * 2**20
"""Largest content that is sent in one piece, and size of the pieces of a larger one [byte]."""
CHUNK = 2**20
"""How much of a download is held in memory [byte]."""
PATIENCE = 600.0
"""For how long a server may be gone by default [s]."""
ATTEMPTS = 3
"""How often a file is sent that changes while it is sent."""

_ABSENT = frozenset({"NoSuchKey", "NoSuchBucket", "NotFound", "ResourceNotFound"})
_TAKEN = frozenset({"BucketAlreadyOwnedByYou", "BucketAlreadyExists"})


@dataclass(frozen=True)
class StoredObject:
    """What a listing says of an object."""

    key: str
    size: int
    """[byte]"""
    modified: float
    """When it was stored [s since the epoch]; whole seconds on some servers."""
    etag: str


class ObjectStore:
    """Buckets and objects of one account; several threads may share it.

    Every method raises `StorageError` when the server refuses, or is gone for too long.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        credentials: Credentials,
        *,
        patience: float = PATIENCE,
        connections: int = 8,
    ) -> None:
        """
        Args:
            endpoint: the server.
            credentials: the account.
            patience: for how long a server that does not answer is asked again [s].
            connections: how many threads share the store.
        """
        self.endpoint = endpoint
        self._patience = patience
        self._client = connect(endpoint, credentials, urllib3.PoolManager, patience, connections)
        self._creating = connect(endpoint, credentials, CreateOnly, patience, connections)

    def buckets(self) -> list[str]:
        """Names of all buckets of the account, sorted."""
        with self._explained("list buckets"):
            return sorted(bucket.name for bucket in self._persist(self._client.list_buckets))

    def has_bucket(self, bucket: str) -> bool:
        """Whether there is such a bucket."""
        with self._explained(f"look for the bucket {bucket}"):
            return self._has_bucket(bucket)

    def make_bucket(self, bucket: str) -> None:
        """Make a bucket; nothing happens when it is there."""
        with self._explained(f"make the bucket {bucket}"):
            if self._has_bucket(bucket):
                return
            try:
                self._persist(lambda: self._client.make_bucket(bucket))
            except S3Error as error:
                if error.code not in _TAKEN or not self._has_bucket(bucket):
                    raise

    def delete_bucket(self, bucket: str) -> None:
        """Remove a bucket with all that is in it; nothing happens when there is none."""
        with self._explained(f"remove the bucket {bucket}"):
            if self._has_bucket(bucket):
                self._persist(lambda: self._empty(bucket))
                self._persist(lambda: self._client.remove_bucket(bucket))

    def _has_bucket(self, bucket: str) -> bool:
        return self._persist(lambda: self._client.bucket_exists(bucket))

    def _empty(self, bucket: str) -> None:
        self._delete(bucket, (item.key for item in self.objects(bucket)))

    def delete(self, bucket: str, keys: Collection[str]) -> None:
        """Remove objects; those that are not there count as removed."""
        with self._explained(f"remove objects from {bucket}"):
            self._persist(lambda: self._delete(bucket, keys))

    def _delete(self, bucket: str, keys: Iterable[str]) -> None:
        for error in self._client.remove_objects(bucket, map(DeleteObject, keys)):
            raise StorageError(f"{bucket}/{error.name} cannot be removed: {error.message}")

    def put_file(self, bucket: str, key: str, path: Path) -> bool:
        """Store a file; False when an equal object was there.

        Raises:
            OSError: the file cannot be read.
        """
        with path.open("rb") as stream:
            return self.put(bucket, key, stream)

    def put_bytes(self, bucket: str, key: str, content: bytes) -> bool:
        """Store a content; False when an equal object was there."""
        return self.put(bucket, key, io.BytesIO(content))

    def put(self, bucket: str, key: str, stream: BinaryIO, *, is_new: bool = False) -> bool:
        """Store the content of an open file from its beginning; False when an equal one was there.

        Args:
            bucket: an existing bucket.
            key: name of the object.
            stream: a file, open for reading in binary mode.
            is_new: spare the question whether it is there.
        """
        with self._explained(f"store {bucket}/{key}"):
            size, digest = _measure(stream)
            if not is_new and self._digest(bucket, key) == digest:
                return False
            for _ in range(ATTEMPTS):
                if self._send(bucket, key, stream, size, digest) == digest:
                    return True
                size, digest = _measure(stream)
        raise StorageError(f"{bucket}/{key}: its file changes again and again while it is stored.")

    def _send(self, bucket: str, key: str, stream: BinaryIO, size: int, digest: str) -> str:
        """Send it; returns the SHA-256 of what was sent."""
        metadata = {DIGEST: digest} | ({MODE: "executable"} if _is_executable(stream) else {})

        def send() -> str:
            reader = _HashingReader(stream)
            self._client.put_object(
                bucket,
                key,
                cast("BinaryIO", reader),
                size,
                metadata=metadata,  # type: ignore[arg-type]
                part_size=PART if size > PART else 0,
            )
            return reader.digest()

        return self._persist(send)

    def create(self, bucket: str, key: str, content: bytes) -> bool:
        """Store a content unless there is an object of this name; False when there is another one.

        Of several that try at once one succeeds, where the server knows conditional writes
        (`If-None-Match`); where it does not, it is looked for first.
        """
        digest = hashlib.sha256(content).hexdigest()
        with self._explained(f"store {bucket}/{key}"):
            try:
                self._persist(
                    lambda: self._creating.put_object(
                        bucket, key, io.BytesIO(content), len(content), metadata={DIGEST: digest}
                    )
                )
            except S3Error as error:
                if error.code == "NotImplemented":
                    return self._create_unconditionally(bucket, key, content, digest)
                if error.code != "PreconditionFailed":
                    raise
                return self._digest(bucket, key) == digest  # ours, when its answer was lost
            return True

    def _create_unconditionally(self, bucket: str, key: str, content: bytes, digest: str) -> bool:
        found = self._digest(bucket, key)
        if found is None:
            self.put_bytes(bucket, key, content)
        return found in {None, digest}

    def digest(self, bucket: str, key: str) -> str | None:
        """SHA-256 that the writer of an object noted, empty without; None when there is none."""
        with self._explained(f"look at {bucket}/{key}"):
            return self._digest(bucket, key)

    def _digest(self, bucket: str, key: str) -> str | None:
        found = self._unless_absent(lambda: self._client.stat_object(bucket, key))
        return _noted(found.metadata or {}, DIGEST) if found else None

    def objects(self, bucket: str, prefix: str = "") -> Iterator[StoredObject]:
        """All objects whose key begins so, sorted by key."""
        with self._explained(f"list {bucket}/{prefix}"):
            for item in self._items(bucket, prefix, recursive=True):
                if not item.object_name.endswith("/"):  # a folder, as some servers show them
                    modified = item.last_modified.timestamp()
                    etag = (item.etag or "").strip('"')
                    yield StoredObject(item.object_name, item.size, modified, etag)

    def folders(self, bucket: str, prefix: str = "") -> list[str]:
        """Names of the folders directly below a prefix that is empty or ends with `/`."""
        with self._explained(f"list {bucket}/{prefix}"):
            items = self._items(bucket, prefix, recursive=False)
            return [item.object_name[len(prefix) : -1] for item in items if item.is_dir]

    def _items(self, bucket: str, prefix: str, *, recursive: bool) -> Iterator[Any]:
        last: str | None = None
        pauses = Pauses(self._patience)
        while True:
            try:
                for item in self._client.list_objects(
                    bucket, prefix, recursive=recursive, start_after=last
                ):
                    last = item.object_name
                    yield item
                return
            except (MinioException, HTTPError) as error:
                if not passes(error) or not pauses.wait():
                    raise

    def read(self, bucket: str, key: str) -> bytes | None:
        """Content of a small object, verified; None when there is none."""

        def read() -> bytes:
            with self._opened(bucket, key) as answer:
                content: bytes = answer.read()
                noted = _noted(answer.headers, DIGEST)
            _verify(f"{bucket}/{key}", noted, hashlib.sha256(content).hexdigest())
            return content

        with self._explained(f"read {bucket}/{key}"):
            return self._unless_absent(read)

    def get_file(
        self,
        bucket: str,
        item: StoredObject,
        target: Path,
        received: Callable[[int], None] = lambda _: None,
    ) -> None:
        """Bring an object home: resumed where an earlier attempt ended, verified, then renamed.

        The file gets the time at which the object was stored, so that it can be told later that
        it is here.

        Args:
            bucket: its bucket.
            item: the object, as listed.
            target: the file; its folder is made.
            received: is told how many bytes arrived, those of earlier attempts included.

        Raises:
            OSError: the file cannot be written.
        """
        target.parent.mkdir(parents=True, exist_ok=True)
        tag = hashlib.sha256(item.etag.encode()).hexdigest()[:8]
        part = target.with_name(f".{target.name[:200]}.{tag}.part")
        meter = _Meter(received)
        with self._explained(f"fetch {bucket}/{item.key}"):
            self._persist(lambda: self._fetch(bucket, item, part, meter))
        os.utime(part, (item.modified, item.modified))
        put_in_place(part, target)

    def _fetch(self, bucket: str, item: StoredObject, part: Path, meter: _Meter) -> None:
        with part.open("ab+") as file:
            if file.tell() >= item.size:
                file.truncate(0)
            file.seek(0)
            hasher = hashlib.file_digest(file, "sha256")
            with self._opened(bucket, item.key, file.tell(), item.etag) as answer:
                headers = dict(answer.headers)
                for chunk in answer.stream(CHUNK):
                    hasher.update(chunk)
                    file.write(chunk)
                    meter.show(file.tell())
            if file.tell() < item.size:
                raise ProtocolError(f"only {file.tell()} of {item.size} bytes arrived")
        try:
            _verify(f"{bucket}/{item.key}", _noted(headers, DIGEST), hasher.hexdigest())
        except StorageError:
            part.unlink()
            raise
        if _noted(headers, MODE):
            part.chmod(EXECUTABLE)

    @contextmanager
    def _opened(self, bucket: str, key: str, offset: int = 0, etag: str = "") -> Iterator[Any]:
        headers: Any = {"If-Match": f'"{etag}"'} if etag else None
        answer = self._client.get_object(bucket, key, offset, request_headers=headers)
        try:
            yield answer
        finally:
            answer.close()
            answer.release_conn()

    def _persist(self, action: Callable[[], T]) -> T:
        return persist(action, self._patience)

    def _unless_absent(self, action: Callable[[], T]) -> T | None:
        try:
            return self._persist(action)
        except S3Error as error:
            if error.code in _ABSENT:
                return None
            raise

    def _explained(self, attempt: str) -> AbstractContextManager[None]:
        return explained(f"{self.endpoint}: cannot {attempt}")


class _HashingReader:
    """Reads a file from its beginning and hashes what is read."""

    def __init__(self, stream: BinaryIO) -> None:
        stream.seek(0)
        self._stream = stream
        self._hash = hashlib.sha256()

    def read(self, size: int = -1) -> bytes:
        data = self._stream.read(size)
        self._hash.update(data)
        return data

    def digest(self) -> str:
        return self._hash.hexdigest()


class _Meter:
    """Tells of each byte once, however often a download begins again."""

    def __init__(self, received: Callable[[int], None]) -> None:
        self._received = received
        self._shown = 0

    def show(self, position: int) -> None:
        if position > self._shown:
            self._received(position - self._shown)
            self._shown = position


def _measure(stream: BinaryIO) -> tuple[int, str]:
    """Size [byte] and SHA-256 of a file, of the very same bytes even when it grows meanwhile."""
    reader, size = _HashingReader(stream), 0
    while data := reader.read(CHUNK):
        size += len(data)
    return size, reader.digest()


def _is_executable(stream: BinaryIO) -> bool:
    try:
        return bool(os.fstat(stream.fileno()).st_mode & 0o100)
    except OSError:  # no file of the file system
        return False


def _noted(headers: Mapping[str, Any], name: str) -> str:
    wanted = f"x-amz-meta-{name}"
    return next((str(value) for key, value in headers.items() if key.lower() == wanted), "")


def _verify(name: str, noted: str, found: str) -> None:
    if noted and noted != found:
        raise StorageError(
            f"{name} is damaged: its SHA-256 is {found}, its writer noted {noted}. When that is "
            "so again, the object in the bucket is broken."
        )
