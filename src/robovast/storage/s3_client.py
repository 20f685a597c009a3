"""The `minio` client, extended to stream uploads and to retry failed requests."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Protocol

import certifi
import urllib3
from minio import Minio
from minio.datatypes import Part
from urllib3.connection import HTTPConnection

from robovast.base.backoff import BUSY, FIRST_PAUSE, LONGEST_PAUSE
from robovast.base.errors import StorageError
from robovast.storage.endpoint import Credentials, Endpoint

MOST_RETRIES = 6
"""How often a single request is repeated; its signature is valid for some minutes only."""
BLOCK = 2**18
"""Part of a body that is in memory [byte]."""


class Body(Protocol):
    """The content of an upload, which is read in blocks, and again from the start for a retry."""

    size: int
    """[byte]"""
    sha256: str
    """SHA-256 in hexadecimal; the server refuses other content."""

    def read(self, size: int = -1, /) -> bytes:
        """The next bytes; empty at the end."""

    def tell(self) -> int:
        """Current position."""

    def seek(self, position: int, /) -> object:
        """Set the position."""


class UploadStoppedError(StorageError):
    """An upload was stopped for something more urgent."""


@dataclass
class _Stoppable:
    """A body whose upload can be stopped after each block."""

    body: Body
    stopped: Callable[[], bool]

    def read(self, size: int = -1, /) -> bytes:
        """The next bytes."""
        if self.stopped():
            raise UploadStoppedError("the upload was stopped for something more urgent")
        return self.body.read(size)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.body, name)


class Client(Minio):
    """Adds streamed bodies, conditional requests, and uploads that can be stopped.

    minio only accepts parts as `bytes`, and no headers except metadata.
    """

    stopped: Callable[[], bool] | None = None

    def put(
        self,
        bucket: str,
        key: str,
        body: Body,
        headers: Mapping[str, str],
        query: Mapping[str, str] | None = None,
    ) -> str:
        """Send an object or a part of one; return its ETag."""
        answer = self._execute(
            "PUT",
            bucket,
            key,
            body=_Stoppable(body, self.stopped) if self.stopped else body,  # type: ignore[arg-type]
            headers=dict(headers),
            query_params=dict(query or {}),
            no_body_trace=True,
        )
        return str(answer.headers.get("etag", "")).strip('"')

    def begin(self, bucket: str, key: str, headers: Mapping[str, str]) -> str:
        """Begin a multipart upload; return its id."""
        return self._create_multipart_upload(bucket, key, dict(headers))

    def complete(self, bucket: str, key: str, upload: str, etags: Sequence[str]) -> None:
        """Complete a multipart upload."""
        parts = [Part(number, etag) for number, etag in enumerate(etags, 1)]
        self._complete_multipart_upload(bucket, key, upload, parts)

    def abort(self, bucket: str, key: str, upload: str) -> None:
        """Discard a multipart upload."""
        self._abort_multipart_upload(bucket, key, upload)

    def _build_headers(
        self, host: str, headers: Any = None, body: Any = None, creds: Any = None
    ) -> tuple[Any, datetime]:
        if body is None or isinstance(body, bytes):
            return super()._build_headers(host, headers, body, creds)
        headers, date = super()._build_headers(host, headers, None, creds)
        facts = {"Content-Length": str(body.size), "x-amz-content-sha256": body.sha256}
        return {**headers, **facts}, date


def connect(
    endpoint: Endpoint,
    credentials: Credentials,
    patience: float,
    connections: int,
    stopped: Callable[[], bool] | None = None,
) -> Client:
    """A thread-safe client.

    Args:
        endpoint: the server.
        credentials: the account.
        patience: limit of all retries [s]; the client itself uses about 30 s of it, `persist`
            the rest.
        connections: size of the connection pool.
        stopped: whether to stop uploads; then little is kept on the way to the server.
    """
    buffer = [(socket.SOL_SOCKET, socket.SO_SNDBUF, BLOCK)] if stopped else []
    client = Client(
        endpoint.host,
        access_key=credentials.access_key,
        secret_key=credentials.secret_key,
        secure=endpoint.secure,
        region=endpoint.region,
        http_client=urllib3.PoolManager(
            timeout=urllib3.Timeout(connect=5, read=60),
            maxsize=connections,
            blocksize=BLOCK,
            ca_certs=os.environ.get("SSL_CERT_FILE") or certifi.where(),
            retries=_retries(patience),
            socket_options=[*HTTPConnection.default_socket_options, *buffer],
        ),
    )
    client.stopped = stopped
    return client


def _retries(patience: float) -> urllib3.Retry:
    """Retry single requests, so that a failed part does not discard the previous parts."""
    number = 0
    while number < MOST_RETRIES and FIRST_PAUSE * 2 ** (number + 1) <= patience:
        number += 1
    return urllib3.Retry(
        total=number,
        backoff_factor=FIRST_PAUSE,
        backoff_max=LONGEST_PAUSE,
        backoff_jitter=FIRST_PAUSE,
        status_forcelist=BUSY,
        allowed_methods=None,
        raise_on_status=False,
    )
