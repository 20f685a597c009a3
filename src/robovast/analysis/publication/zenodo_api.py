"""The required part of Zenodo's REST API for deposits (https://developers.zenodo.org).

These are five requests. The only library for such servers, `inveniordm-py`, is at version 0.1.1.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast
from urllib.parse import quote, urlsplit

from robovast.base.backoff import TRANSFERRING
from robovast.base.errors import InputError, StorageError
from robovast.storage.http_client import HttpClient, HttpError
from robovast.storage.shares.base import UploadProgressReader

_JSON = {"Content-Type": "application/json"}
_LOOPBACK = frozenset({"127.0.0.1", "::1", "localhost"})
_ACCOUNT_REMEDY = (
    "check the access token: it must be of this server (the sandbox has its own), and have the "
    "scopes `deposit:write` and `deposit:actions`"
)


@dataclass(frozen=True)
class Deposit:
    """A record, either a draft or published."""

    id: int
    published: bool
    page: str
    """Address of the web page."""
    doi: str
    bucket: str
    """Address for uploads."""
    files: Mapping[str, str]
    """MD5 of each file by name, in hexadecimal."""

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Deposit:
        """Parse a response."""
        links = data.get("links") or {}
        reserved = (data.get("metadata") or {}).get("prereserve_doi") or {}
        return cls(
            id=int(data["id"]),
            published=bool(data.get("submitted")),
            page=str(links.get("html", "")),
            doi=str(data.get("doi") or reserved.get("doi") or ""),
            bucket=str(links.get("bucket", "")),
            files={
                str(file.get("filename")): _md5(str(file.get("checksum", "")))
                for file in data.get("files") or ()
            },
        )


class ZenodoApi:
    """Access to the deposits of one account."""

    def __init__(self, address: str, token: str, *, patience: float = TRANSFERRING) -> None:
        """
        Args:
            address: address of the server, such as `https://zenodo.org`.
            token: access token of the account.
            patience: how long requests are repeated if the server is busy or unreachable [s].

        Raises:
            InputError: the address would expose the token.
        """
        place = urlsplit(address)
        if place.scheme != "https" and place.hostname not in _LOOPBACK:
            raise InputError(
                f"{address}: does not begin with https, but gets an access token",
                hint="use an address with https://",
            )
        self._address = address.rstrip("/")
        self._place = (place.scheme, place.netloc)
        self._client = HttpClient(
            place.netloc,
            {"Authorization": f"Bearer {token}"},
            remedies={401: _ACCOUNT_REMEDY, 403: _ACCOUNT_REMEDY},
            secrets=[token],
            patience=patience,
        )

    def deposit(self, number: int) -> Deposit | None:
        """A deposit by its number, or None."""
        answer = self._client.request(
            "GET", self._url(number), attempt=f"look at deposit {number}", accept={404, 410}
        )
        return Deposit.of(self._client.data(answer)) if answer.status < 300 else None

    def make_draft(self) -> Deposit:
        """Create an empty draft."""
        answer = self._client.request(
            "POST",
            f"{self._address}/api/deposit/depositions",
            attempt="create a draft",
            body=lambda: b"{}",
            headers=_JSON,
            repeatable=False,  # it would leave a second draft
        )
        return Deposit.of(self._client.data(answer))

    def describe(self, draft: Deposit, metadata: Mapping[str, Any]) -> None:
        """Set a draft's metadata."""
        content = json.dumps({"metadata": dict(metadata)}).encode()
        self._client.request(
            "PUT",
            self._url(draft.id),
            attempt="describe the draft",
            body=lambda: content,
            headers=_JSON,
        )

    def upload(self, draft: Deposit, path: Path, progress: Callable[[int, int], None]) -> None:
        """Upload a file to a draft; an existing file of that name is replaced.

        Raises:
            StorageError: it could not be uploaded, or arrived damaged.
            OSError: the file cannot be read.
        """
        if urlsplit(draft.bucket)[:2] != self._place:
            raise StorageError(
                f"{self._client.name}: uploads would go to another server ({draft.bucket}), which "
                "must not receive the access token."
            )
        with path.open("rb") as stream:
            size = path.stat().st_size

            def body() -> IO[bytes]:
                stream.seek(0)
                return cast("IO[bytes]", UploadProgressReader(stream, size, progress))

            answer = self._client.request(
                "PUT",
                f"{draft.bucket}/{quote(path.name)}",
                attempt=f"upload {path.name}",
                body=body,
                headers={
                    "Content-Type": "application/octet-stream",
                    "Content-Length": str(size),
                },
            )
        found = _md5(str(self._client.data(answer).get("checksum", "")))
        if found != md5_of(path):
            raise StorageError(
                f"{self._client.name}: {path.name} arrived damaged, or changed during the upload "
                f"(MD5 {found or 'unknown'})",
                hint="publish again",
            )

    def publish(self, draft: Deposit) -> Deposit:
        """Publish a draft; this cannot be undone."""
        try:
            answer = self._client.request(
                "POST",
                f"{self._url(draft.id)}/actions/publish",
                attempt=f"publish deposit {draft.id}",
                repeatable=False,
            )
        except HttpError:
            raise
        except StorageError:  # only the answer may be lost: check whether it is published
            found = self.deposit(draft.id)
            if found is None or not found.published:
                raise
            return found
        return Deposit.of(self._client.data(answer))

    def _url(self, number: int) -> str:
        return f"{self._address}/api/deposit/depositions/{number}"


def md5_of(path: Path) -> str:
    """MD5 of a file, the checksum that Zenodo reports."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.md5(usedforsecurity=False)).hexdigest()


def _md5(checksum: str) -> str:
    return checksum.removeprefix("md5:")
