"""The `minio` client, set up to stream what it sends and to repeat what fails on the way."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any, Protocol

import certifi
import urllib3
from minio import Minio
from minio.datatypes import Part

from robovast.base.backoff import BUSY, FIRST_PAUSE, LONGEST_PAUSE
from robovast.storage.endpoint import Credentials, Endpoint

MOST_RETRIES = 6
"""How often one request is repeated as it is: its signature holds for some minutes only."""
BLOCK = 2**18
"""How much of a body is in memory [byte]."""


class Body(Protocol):
    """What an upload sends: read in pieces, and from its beginning when it is repeated."""

    size: int
    """[byte]"""
    sha256: str
    """In hexadecimal digits; the server refuses anything else."""

    def read(self, size: int = -1, /) -> bytes:
        """The next bytes; empty at the end."""

    def tell(self) -> int:
        """How much was read."""

    def seek(self, position: int, /) -> object:
        """Go on reading elsewhere."""


class Client(Minio):
    """Also sends bodies that are not in memory, under conditions.

    The client has neither: it takes a part as `bytes`, and no headers beside metadata.
    """

    def put(
        self,
        bucket: str,
        key: str,
        body: Body,
        headers: Mapping[str, str],
        query: Mapping[str, str] | None = None,
    ) -> str:
        """Send an object, or a part of one; returns its ETag."""
        answer = self._execute(
            "PUT",
            bucket,
            key,
            body=body,  # type: ignore[arg-type]
            headers=dict(headers),
            query_params=dict(query or {}),
            no_body_trace=True,
        )
        return str(answer.headers.get("etag", "")).strip('"')

    def begin(self, bucket: str, key: str, headers: Mapping[str, str]) -> str:
        """Begin an object of several parts; returns the id of the upload."""
        return self._create_multipart_upload(bucket, key, dict(headers))

    def complete(self, bucket: str, key: str, upload: str, etags: Sequence[str]) -> None:
        """Make an object of its parts."""
        parts = [Part(number, etag) for number, etag in enumerate(etags, 1)]
        self._complete_multipart_upload(bucket, key, upload, parts)

    def abort(self, bucket: str, key: str, upload: str) -> None:
        """Forget the parts of an object."""
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
    endpoint: Endpoint, credentials: Credentials, patience: float, connections: int
) -> Client:
    """A client that several threads may share.

    Args:
        endpoint: the server.
        credentials: the account.
        patience: longest time of the client's own retries [s], of which it uses about 30; `persist`
            repeats beyond that.
        connections: how many are kept.
    """
    return Client(
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
        ),
    )


def _retries(patience: float) -> urllib3.Retry:
    """Repeated by itself, a part of a large file does not cost the parts before it."""
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
