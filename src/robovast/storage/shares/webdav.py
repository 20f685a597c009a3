"""Shares on WebDAV servers.

Beside plain HTTP it needs two methods, PROPFIND and MOVE. The package `webdav4` would bring a
second HTTP client with other rules for retries and credentials (`httpx`, 6 MiB).
"""

from __future__ import annotations

import base64
import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import IO, ClassVar, cast
from urllib.parse import quote, unquote, urlsplit

from robovast.base.errors import InputError, StorageError
from robovast.base.xml_files import parse_xml
from robovast.storage.http_client import HttpClient, HttpError
from robovast.storage.http_download import download
from robovast.storage.shares.base import (
    INSECURE_SSL,
    BaseShareProvider,
    ProgressCallback,
    UploadProgressReader,
    accepts_any_certificate,
    probe_name,
)

URL = "ROBOVAST_WEBDAV_URL"
USER = "ROBOVAST_WEBDAV_USER"
PASSWORD = "ROBOVAST_WEBDAV_PASSWORD"  # noqa: S105 - the name of a variable

_THIS_MACHINE = frozenset({"localhost", "127.0.0.1", "::1"})

LOGGER = logging.getLogger(__name__)

_LOOK = b"""<?xml version="1.0"?>
<propfind xmlns="DAV:"><prop><resourcetype/><getcontentlength/></prop></propfind>"""
_NOT_THERE = 404
_REFUSALS = range(300, 600)


class WebDavShareProvider(BaseShareProvider):
    """A folder on a WebDAV server, with user name and password."""

    SHARE_TYPE: ClassVar[str] = "webdav"
    PUT_IS_ATOMIC: ClassVar[bool] = False
    """Whether uploaded files become visible only when they are complete."""

    def required_env_vars(self) -> dict[str, str]:
        """Address and account."""
        return {
            URL: "address of the folder, as https://dav.example.org/results/",
            USER: "name of the account",
            PASSWORD: "password of the account",
        }

    def build_pod_env(self) -> dict[str, str]:
        """The same variables."""
        names = [*self.required_env_vars(), INSECURE_SSL]
        return {name: os.environ[name] for name in names if name in os.environ}

    def verify_access(self) -> None:
        """Write a small file and remove it."""
        probe = self._folder + probe_name()
        self._client.request("PUT", probe, attempt="write to the folder", body=lambda: b"")
        # If the response of a first attempt was lost, the file is gone already.
        self._client.request("DELETE", probe, attempt="remove from the folder", accept={_NOT_THERE})

    def upload_archive(
        self,
        archive_path: str,
        object_name: str,
        progress_callback: ProgressCallback | None = None,
    ) -> None:
        """Upload an archive under a temporary name, then rename it."""
        path = Path(archive_path)
        target = self._url(object_name)
        part = target if self.PUT_IS_ATOMIC else self._url(f".{object_name}.part")
        try:
            self._put(path, part, object_name, progress_callback)
        except HttpError:
            if part != target:  # do not leave partial files on a full share
                with suppress(StorageError):
                    self._client.request("DELETE", part, attempt="tidy up", accept=_REFUSALS)
            raise
        self._check_size(part, object_name, path.stat().st_size)
        if part != target:
            self._client.request(
                "MOVE",
                part,
                attempt=f"rename {object_name}",
                headers={"Destination": target, "Overwrite": "T"},
                repeatable=False,
            )

    def list_campaign_archives_with_size(self) -> list[tuple[str, int]]:
        """Archives in the folder, not in folders below it."""
        found = self._look(self._folder, "1", "list the folder")
        return sorted(
            (name, size)
            for name, size in found.items()
            if name.endswith(".tar.gz") and not name.startswith(".")
        )

    def download_archive(
        self,
        object_name: str,
        dest: str,
        progress_callback: ProgressCallback | None = None,
        resume_offset: int = 0,
    ) -> None:
        """Download an archive; after an interruption, only the rest is downloaded."""
        download(
            self._client,
            self._url(object_name),
            Path(dest),
            attempt=f"download {object_name}",
            offset=resume_offset,
            progress=progress_callback,
        )

    def remove_archive(self, name: str) -> None:
        """Remove an archive."""
        answer = self._client.request(
            "DELETE", self._url(name), attempt=f"remove {name}", accept={_NOT_THERE}
        )
        if answer.status == _NOT_THERE:
            raise InputError(f"{self._client.name}: there is no {name}.")

    def archive_exists_on_share(self, name: str) -> bool:
        """Look for a single archive."""
        answer = self._client.request(
            "HEAD", self._url(name), attempt=f"look for {name}", accept={_NOT_THERE}
        )
        return answer.status != _NOT_THERE

    def address(self) -> tuple[str, str, str]:
        """Address of the folder, user and password.

        Raises:
            InputError: it is not a valid address.
        """
        url = os.environ[URL].strip()
        if not url.startswith(("https://", "http://")):
            raise InputError(
                f"{URL} does not begin with https://",
                hint="set it for example to https://dav.example.org/results/",
            )
        return url, os.environ[USER], os.environ[PASSWORD]

    @cached_property
    def _client(self) -> HttpClient:
        url, user, password = self.address()
        parts = urlsplit(url)
        if parts.scheme == "http" and parts.hostname not in _THIS_MACHINE:
            LOGGER.warning(
                "%s: http:// does not encrypt the account and the results. Use an https:// "
                "address if the server has one.",
                parts.netloc.rpartition("@")[2],
            )
        account = base64.b64encode(f"{user}:{password}".encode()).decode()
        return HttpClient(
            parts.netloc.rpartition("@")[2],
            {"Authorization": f"Basic {account}"},
            remedies=self.remedies(),
            secrets=[password, account],
            insecure=accepts_any_certificate(),
        )

    def remedies(self) -> Mapping[int, str]:
        """Remedies by HTTP status."""
        return {
            401: f"check {USER} and {PASSWORD}",
            404: f"check {URL}: the folder must exist",
            409: f"check {URL}: the folder must exist",
        }

    @property
    def _folder(self) -> str:
        return self.address()[0].rstrip("/") + "/"

    def _url(self, name: str) -> str:
        return self._folder + quote(name, safe="")

    def _put(self, path: Path, url: str, name: str, progress: ProgressCallback | None) -> None:
        size = path.stat().st_size
        with path.open("rb") as stream:

            def body() -> IO[bytes]:
                stream.seek(0)
                return cast("IO[bytes]", UploadProgressReader(stream, size, progress))

            self._client.request(
                "PUT",
                url,
                attempt=f"upload {name}",
                body=body,
                headers={"Content-Length": str(size), "Content-Type": "application/gzip"},
            )

    def _check_size(self, url: str, name: str, size: int) -> None:
        (found,) = self._look(url, "0", f"look at {name}").values() or [0]
        if found != size:
            raise StorageError(
                f"{self._client.name}: of {name} only {found} of {size} bytes arrived",
                hint="check the free space on the server",
            )

    def _look(self, url: str, depth: str, attempt: str) -> dict[str, int]:
        """Size [byte] of each file in a PROPFIND response."""
        answer = self._client.request(
            "PROPFIND",
            url,
            attempt=attempt,
            body=lambda: _LOOK,
            headers={"Depth": depth, "Content-Type": "application/xml"},
        )
        try:
            return dict(_files(answer.data))
        except ValueError as error:
            raise StorageError(
                f"{self._client.name}: does not answer as a WebDAV server does ({error})",
                hint="check the address",
            ) from error


def _files(content: bytes) -> Iterator[tuple[str, int]]:
    for response in parse_xml(content).iter("{DAV:}response"):
        href = response.findtext("{DAV:}href", "")
        if response.find(".//{DAV:}resourcetype/{DAV:}collection") is None:
            size = response.findtext(".//{DAV:}getcontentlength") or "0"
            yield unquote(urlsplit(href).path.rstrip("/").rpartition("/")[2]), int(size)
