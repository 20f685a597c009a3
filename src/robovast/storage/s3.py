"""An S3 client that retries, verifies checksums, and skips work that is already done.

Every object has the SHA-256 of its content as metadata. Writes are idempotent: equal content is
not sent again. A server that restarts or is unreachable for a while only costs time.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from minio.deleteobjects import DeleteObject
from minio.error import MinioException, S3Error
from urllib3.exceptions import HTTPError, ProtocolError

from robovast.base.atomic import put_in_place
from robovast.base.backoff import HOLDING_RESULTS, Pauses
from robovast.base.errors import StorageError
from robovast.base.sizes import whole_number
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.multipart import ChangedError, Content, measured, of_bytes, send
from robovast.storage.s3_client import connect
from robovast.storage.s3_errors import ObjectError, passes, persist, storage_errors

T = TypeVar("T")

DIGEST = "sha256"
"""Metadata key of the content's SHA-256, in hexadecimal."""
MODE = "mode"
"""Metadata key of executable files."""
EXECUTABLE = 0o755

PARTS = 4
"""Number of parts of large files that are sent in parallel, for all files together."""
SMALL = 256 * 1024 * 1024
"""Larger objects are never read into memory [byte]."""

CHUNK = 2**20
"""Block size of downloads [byte]."""
ATTEMPTS = 3
"""How often to send a file that changes meanwhile."""

_ABSENT = frozenset({"NoSuchKey", "NoSuchBucket", "NotFound", "ResourceNotFound"})
_REFUSED = frozenset({"PreconditionFailed", "NoSuchKey"})
_TAKEN = frozenset({"BucketAlreadyOwnedByYou", "BucketAlreadyExists"})


@dataclass(frozen=True)
class StoredObject:
    """An object in a listing."""

    key: str
    size: int
    """[byte]"""
    modified: float
    """Time of storage [s since the epoch]; whole seconds on some servers."""
    etag: str
    """ETag; empty if unknown."""
    sha256: str = ""
    """SHA-256, if it is known from elsewhere than the object's metadata."""


@dataclass(frozen=True)
class Look:
    """A consistent view of a small object."""

    content: bytes
    etag: str
    modified: float
    """Time of storage [s since the epoch], in whole seconds."""


class ObjectStore:
    """Access to the buckets and objects of one account; thread-safe.

    Every method raises `StorageError` if the server refuses, or is unreachable for too long.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        credentials: Credentials,
        *,
        patience: float = HOLDING_RESULTS,
        connections: int = 8,
        stopped: Callable[[], bool] | None = None,
    ) -> None:
        """
        Args:
            endpoint: the server.
            credentials: the account.
            patience: how long to retry if the server does not respond [s].
            connections: number of threads that share the store.
            stopped: whether to stop uploads, which then raise `StoppedError`.
        """
        self.endpoint = endpoint
        self._patience = patience
        self._client = connect(endpoint, credentials, patience, connections + PARTS, stopped)
        self._parts = ThreadPoolExecutor(PARTS, "parts")

    def buckets(self) -> list[str]:
        """Names of all buckets of the account, sorted."""
        with self._storage_errors("list buckets"):
            return sorted(bucket.name for bucket in self._persist(self._client.list_buckets))

    def has_bucket(self, bucket: str) -> bool:
        """Whether a bucket exists."""
        with self._storage_errors(f"look for the bucket {bucket}"):
            return self._has_bucket(bucket)

    def make_bucket(self, bucket: str) -> None:
        """Create a bucket unless it exists."""
        with self._storage_errors(f"create the bucket {bucket}"):
            if self._has_bucket(bucket):
                return
            try:
                self._persist(lambda: self._client.make_bucket(bucket))
            except S3Error as error:
                if error.code not in _TAKEN or not self._has_bucket(bucket):
                    raise

    def delete_bucket(self, bucket: str, *, last: str = "", content: bool = True) -> None:
        """Remove a bucket, if it exists.

        Args:
            bucket: its name.
            last: key of the object that is removed after all others.
            content: whether to remove the content. Otherwise, only an empty bucket can be removed.
        """
        with self._storage_errors(f"remove the bucket {bucket}"):
            if self._has_bucket(bucket):
                if content:
                    self._persist(lambda: self._empty(bucket, last))
                self._persist(lambda: self._client.remove_bucket(bucket))

    def _has_bucket(self, bucket: str) -> bool:
        return self._persist(lambda: self._client.bucket_exists(bucket))

    def _empty(self, bucket: str, last: str) -> None:
        names = (item.object_name for item in self._items(bucket, "", recursive=True))
        self._delete(bucket, (name for name in names if name != last))
        self._delete(bucket, [last] if last else [])

    def delete(self, bucket: str, keys: Collection[str]) -> None:
        """Remove objects; missing ones are ignored."""
        with self._storage_errors(f"remove objects from {bucket}"):
            self._persist(lambda: self._delete(bucket, keys))

    def _delete(self, bucket: str, keys: Iterable[str]) -> None:
        for error in self._client.remove_objects(bucket, map(DeleteObject, keys)):
            raise StorageError(f"{bucket}/{error.name} cannot be removed: {error.message}")

    def put_file(self, bucket: str, key: str, path: Path) -> bool:
        """Store a file; return False if an equal object exists.

        Raises:
            OSError: the file cannot be read.
        """
        with path.open("rb") as stream:
            return self.put(bucket, key, stream)

    def put_bytes(self, bucket: str, key: str, content: bytes) -> bool:
        """Store content; return False if an equal object exists."""
        with self._storage_errors(f"store {bucket}/{key}"):
            return self._put(bucket, key, of_bytes(content), {})

    def put(self, bucket: str, key: str, file: BinaryIO) -> bool:
        """Store an open file's content; return False if an equal object exists.

        Raises:
            OSError: the file cannot be read, or keeps changing.
        """
        with self._storage_errors(f"store {bucket}/{key}"):
            return self._steady(file, lambda content, mode: self._put(bucket, key, content, mode))

    def put_new(self, bucket: str, key: str, file: BinaryIO) -> Content:
        """Store an open file's content without a look at what is there; return what was stored.

        Raises:
            OSError: the file cannot be read, or keeps changing.
        """

        def store(content: Content, mode: Mapping[str, str]) -> Content:
            self._send(bucket, key, content, mode)
            return content

        with self._storage_errors(f"store {bucket}/{key}"):
            return self._steady(file, store)

    def _steady(self, file: BinaryIO, store: Callable[[Content, Mapping[str, str]], T]) -> T:
        executable = os.fstat(file.fileno()).st_mode & 0o100
        for _ in range(ATTEMPTS):
            try:
                return store(measured(file), {MODE: "executable"} if executable else {})
            except ChangedError:
                continue
        raise OSError("it keeps changing while it is being stored")

    def _put(self, bucket: str, key: str, content: Content, metadata: Mapping[str, str]) -> bool:
        if self._digest(bucket, key) == content.sha256:
            return False
        self._send(bucket, key, content, metadata)
        return True

    def _send(
        self,
        bucket: str,
        key: str,
        content: Content,
        metadata: Mapping[str, str],
        condition: Mapping[str, str] | None = None,
    ) -> None:
        noted = {f"x-amz-meta-{k}": v for k, v in {DIGEST: content.sha256, **metadata}.items()}
        headers = {**noted, **(condition or {})}
        self._persist(lambda: send(self._client, self._parts, bucket, key, content, headers))

    def create(self, bucket: str, key: str, content: bytes) -> bool:
        """Store content unless the object exists; return False if another one exists.

        Of several concurrent calls one succeeds if the server supports conditional writes
        (`If-None-Match`); on other servers the existence is checked first.
        """
        return self._store_if(bucket, key, content, None)

    def replace(self, bucket: str, key: str, content: bytes, etag: str) -> bool:
        """Replace the object with this ETag; return False if another one exists.

        Of several concurrent calls one succeeds if the server supports conditional writes
        (`If-Match`); on other servers the ETag is checked first.
        """
        return self._store_if(bucket, key, content, etag)

    def _store_if(self, bucket: str, key: str, content: bytes, etag: str | None) -> bool:
        sent = of_bytes(content)
        condition = {"If-None-Match": "*"} if etag is None else {"If-Match": f'"{etag}"'}
        with self._storage_errors(f"store {bucket}/{key}"):
            try:
                self._send(bucket, key, sent, {}, condition)
            except S3Error as error:
                if error.code == "NotImplemented":
                    return self._store_unless(bucket, key, sent, etag)
                if error.code not in _REFUSED:
                    raise
                return self._digest(bucket, key) == sent.sha256  # ours: only the response was lost
            return True

    def _store_unless(self, bucket: str, key: str, content: Content, etag: str | None) -> bool:
        found = self._stat(bucket, key)
        if (_etag(found) if found else None) == etag:
            self._send(bucket, key, content, {})
            return True
        return found is not None and _noted(found.metadata or {}, DIGEST) == content.sha256

    def digest(self, bucket: str, key: str) -> str | None:
        """SHA-256 in an object's metadata, or empty; None if the object is missing."""
        with self._storage_errors(f"look at {bucket}/{key}"):
            return self._digest(bucket, key)

    def _digest(self, bucket: str, key: str) -> str | None:
        found = self._stat(bucket, key)
        return _noted(found.metadata or {}, DIGEST) if found else None

    def _stat(self, bucket: str, key: str) -> Any:
        return self._unless_absent(lambda: self._client.stat_object(bucket, key))

    def objects(self, bucket: str, prefix: str = "") -> Iterator[StoredObject]:
        """All objects whose key has a prefix, sorted by key."""
        with self._storage_errors(f"list {bucket}/{prefix}"):
            for item in self._items(bucket, prefix, recursive=True):
                if item.size or not item.object_name.endswith("/"):  # some servers list folders
                    modified = item.last_modified.timestamp()
                    yield StoredObject(item.object_name, item.size, modified, _etag(item))

    def folders(self, bucket: str, prefix: str = "") -> list[str]:
        """Names of the folders directly below a prefix, which is empty or ends with `/`."""
        with self._storage_errors(f"list {bucket}/{prefix}"):
            items = self._items(bucket, prefix, recursive=False)
            return [item.object_name[len(prefix) : -1] for item in items if item.is_dir]

    def _items(self, bucket: str, prefix: str, *, recursive: bool) -> Iterator[Any]:
        first = last = None
        pauses = Pauses(self._patience)
        while True:
            try:
                for item in self._client.list_objects(
                    bucket, prefix, recursive=recursive, start_after=last
                ):
                    if last is not None and item.object_name == first:
                        raise StorageError(f"{bucket}: the server lists the same objects again.")
                    last = item.object_name
                    first = first or last
                    yield item
                return
            except (MinioException, HTTPError) as error:
                if not passes(error) or not pauses.wait():
                    raise

    def read(self, bucket: str, key: str, limit: int = SMALL) -> bytes | None:
        """Verified content of a small object; None if it is missing."""
        found = self.look(bucket, key, limit)
        return found.content if found else None

    def look(self, bucket: str, key: str, limit: int = SMALL) -> Look | None:
        """A small object, verified; None if it is missing.

        Raises:
            ObjectError: it is larger than the limit.
        """

        def read() -> Look:
            with self._opened(bucket, key) as answer:
                headers = answer.headers
                size = whole_number(headers.get("Content-Length"))
                if size > limit:
                    raise ObjectError(
                        f"{bucket}/{key} has {size:,} bytes, more than the {limit:,} that are read"
                    )
                content: bytes = answer.read()
            _verify(f"{bucket}/{key}", _noted(headers, DIGEST), hashlib.sha256(content).hexdigest())
            modified = parsedate_to_datetime(headers["Last-Modified"]).timestamp()
            return Look(content, str(headers["ETag"]).strip('"'), modified)

        with self._storage_errors(f"read {bucket}/{key}"):
            return self._unless_absent(read)

    def get_file(
        self,
        bucket: str,
        item: StoredObject,
        target: Path,
        received: Callable[[int], None] = lambda _: None,
    ) -> None:
        """Download an object: resume an earlier attempt, verify it, and rename it when complete.

        The file gets the object's time of storage, so that later downloads can recognize it.

        Args:
            bucket: its bucket.
            item: the object, as listed.
            target: the file; its folder is created.
            received: called with the number of bytes, including those of earlier attempts.

        Raises:
            ObjectError: the object is damaged or has changed.
            OSError: the file cannot be written.
        """
        target.parent.mkdir(parents=True, exist_ok=True)
        part = _part(target, f"{item.key} {item.etag or item.sha256}")
        meter = _Meter(received)
        try:
            with self._storage_errors(f"fetch {bucket}/{item.key}"):
                self._persist(lambda: self._fetch(bucket, item, part, meter))
        except ObjectError:  # the content is wrong
            part.unlink(missing_ok=True)
            raise
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
                _verify_size(f"{bucket}/{item.key}", item.size, file.tell(), headers)
                for chunk in answer.stream(CHUNK):
                    hasher.update(chunk)
                    file.write(chunk)
                    meter.show(file.tell())
            if file.tell() < item.size:
                raise ProtocolError(f"only {file.tell()} of {item.size} bytes arrived")
        noted = item.sha256 or _noted(headers, DIGEST)
        _verify(f"{bucket}/{item.key}", noted, hasher.hexdigest())
        if _noted(headers, MODE):
            part.chmod(EXECUTABLE)

    def find(self, bucket: str, key: str) -> StoredObject | None:
        """An object as a listing has it; None if it is missing."""
        with self._storage_errors(f"look at {bucket}/{key}"):
            found = self._stat(bucket, key)
        if found is None:
            return None
        return StoredObject(key, found.size, found.last_modified.timestamp(), _etag(found))

    def read_part(self, bucket: str, item: StoredObject, offset: int, length: int) -> bytes:
        """Some bytes of an object; fewer at its end.

        Raises:
            ObjectError: the object was replaced since it was listed.
        """
        length = min(length, item.size - offset)
        if length <= 0:
            return b""

        def read() -> bytes:
            with self._opened(bucket, item.key, offset, item.etag, length) as answer:
                content: bytes = answer.read()
            if len(content) < length:
                raise ProtocolError(f"only {len(content)} of {length} bytes arrived")
            return content

        with self._storage_errors(f"read {bucket}/{item.key}"):
            return self._persist(read)

    @contextmanager
    def _opened(
        self, bucket: str, key: str, offset: int = 0, etag: str = "", length: int = 0
    ) -> Iterator[Any]:
        headers: Any = {"If-Match": f'"{etag}"'} if etag else None
        answer = self._client.get_object(bucket, key, offset, length, request_headers=headers)
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

    def _storage_errors(self, attempt: str) -> AbstractContextManager[None]:
        return storage_errors(f"{self.endpoint}: cannot {attempt}")


class _Meter:
    """Reports each byte once, however often a download restarts."""

    def __init__(self, received: Callable[[int], None]) -> None:
        self._received = received
        self._shown = 0

    def show(self, position: int) -> None:
        if position > self._shown:
            self._received(position - self._shown)
            self._shown = position


def _part(target: Path, content: str) -> Path:
    """Temporary path of a file, named after its content so that it can be resumed."""
    tag = hashlib.sha256(content.encode("utf-8", "surrogateescape")).hexdigest()[:12]
    name = os.fsdecode(os.fsencode(target.name)[:200])  # file systems count bytes
    return target.with_name(f".{name}.{tag}.part")


def _etag(found: Any) -> str:
    return str(found.etag or "").strip('"')


def _noted(headers: Mapping[str, Any], name: str) -> str:
    wanted = f"x-amz-meta-{name}"
    return next((str(value) for key, value in headers.items() if key.lower() == wanted), "")


def _verify(name: str, noted: str, found: str) -> None:
    if noted and noted != found:
        raise ObjectError(
            f"{name} is damaged: its SHA-256 is {found}, its writer recorded {noted}",
            hint="repeat the command; if it fails again, the object in the bucket is damaged",
        )


def _verify_size(name: str, expected: int, offset: int, headers: Mapping[str, str]) -> None:
    length = next(
        (whole_number(v, -1) for k, v in headers.items() if k.lower() == "content-length"), None
    )
    if length is not None and offset + length != expected:
        raise ObjectError(
            f"{name} is damaged: it has {offset + length} bytes, its writer recorded {expected}",
            hint="repeat the command; if it fails again, the object in the bucket is damaged",
        )
