"""Shares in Google Cloud Storage, by its JSON API.

It is written by hand, since Google's client would add 16 packages and 12 MiB to the 23 MiB of the
extra `share`, take 1.5 s to import (this module: 0.3 s), and report no progress of an upload.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import time
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import IO, Any, ClassVar
from urllib.parse import quote, urlencode, urlsplit

from robovast.base.errors import InputError, StorageError
from robovast.base.file_errors import read_text
from robovast.base.optional_deps import SHARE
from robovast.base.sizes import whole_number
from robovast.storage.http_client import HttpClient
from robovast.storage.http_download import download
from robovast.storage.shares.base import BaseShareProvider, ProgressCallback

BUCKET = "ROBOVAST_GCS_BUCKET"
PREFIX = "ROBOVAST_GCS_PREFIX"
KEY_FILE = "ROBOVAST_GCS_KEY_FILE"
KEY_JSON = "ROBOVAST_GCS_KEY_JSON"
IDLE_ANSWERS = 3
"""Number of answers without progress after which an upload fails."""
EMULATOR = "STORAGE_EMULATOR_HOST"
"""Address of a server in place of Google's, with the name that Google's own libraries use."""

PART = 16 * 2**20
"""Size of an upload request [byte]; a multiple of 256 KiB."""

_SERVER = "https://storage.googleapis.com"
_SCOPE = "https://www.googleapis.com/auth/devstorage.read_write"
_TOKEN_LIFE = 3600
"""[s]"""
_NOT_THERE = 404
_GO_ON = 308


class GcsShareProvider(BaseShareProvider):
    """A bucket; reading a public one needs no key."""

    SHARE_TYPE: ClassVar[str] = "gcs"

    def __init__(self) -> None:
        self._token = ""
        self._token_ends = 0.0

    def required_env_vars(self) -> dict[str, str]:
        """The bucket; a key is required only for uploading and removing."""
        return {BUCKET: "name of the bucket"}

    def build_pod_env(self) -> dict[str, str]:
        """The variables, with the key's content in place of its file."""
        names = (BUCKET, PREFIX, EMULATOR)
        env = {name: os.environ[name] for name in names if name in os.environ}
        key = _key()
        return {**env, **({KEY_JSON: json.dumps(key)} if key else {})}

    def verify_access(self) -> None:
        """Check that the account may upload."""
        right = "storage.objects.create"
        answer = self._client.request(
            "GET",
            f"{self._api}/iam/testPermissions?permissions={right}",
            attempt="read the permissions of the account",
            headers=self._authorization(needed=True),
        )
        if right not in self._client.data(answer).get("permissions", []):
            raise StorageError(
                f"{self._client.name}: the account may not upload to the bucket; it needs the role "
                "Storage Object Creator."
            )

    def upload_archive(
        self,
        archive_path: str,
        object_name: str,
        progress_callback: ProgressCallback | None = None,
    ) -> None:
        """Upload an archive in parts; after an interruption, the rest is sent."""
        path = Path(archive_path)
        size = path.stat().st_size
        session = self._begin_upload(object_name, size)
        with path.open("rb") as stream:
            stored = self._send(stream, session, object_name, size, progress_callback)
        found = stored.get("md5Hash")
        if found and found != _md5(path):
            raise StorageError(
                f"{self._client.name}: {object_name} is damaged, or was changed during the "
                "upload. Upload it again."
            )

    def list_campaign_archives_with_size(self) -> list[tuple[str, int]]:
        """Archives directly below the prefix."""
        found: list[tuple[str, int]] = []
        seen: set[str] = set()
        query = {
            "prefix": self._prefix,
            "delimiter": "/",
            "fields": "items(name,size),nextPageToken",
        }
        while True:
            answer = self._client.request(
                "GET",
                f"{self._api}/o?{urlencode(query)}",
                attempt="list the bucket",
                headers=self._authorization(),
            )
            data = self._client.data(answer)
            for item in data.get("items", []):
                name = str(item["name"]).removeprefix(self._prefix)
                if name.endswith(".tar.gz"):
                    found.append((name, int(item["size"])))
            token = data.get("nextPageToken")
            if token is None:
                return sorted(found)
            if token in seen:
                raise StorageError(
                    f"{self._client.name}: cannot list the bucket: the server sends the same page "
                    "again and again. Check a proxy on the way to the server."
                )
            seen.add(token)
            query["pageToken"] = token

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
            f"{self._object(object_name)}?alt=media",
            Path(dest),
            attempt=f"download {object_name}",
            offset=resume_offset,
            headers=self._authorization(),
            progress=progress_callback,
        )

    def remove_archive(self, name: str) -> None:
        """Remove an archive."""
        answer = self._client.request(
            "DELETE",
            self._object(name),
            attempt=f"remove {name}",
            headers=self._authorization(needed=True),
            accept={_NOT_THERE},
        )
        if answer.status == _NOT_THERE:
            raise InputError(f"{self._client.name}: there is no {name}.")

    def archive_exists_on_share(self, name: str) -> bool:
        """Look for a single archive."""
        answer = self._client.request(
            "GET",
            self._object(name),
            attempt=f"look for {name}",
            headers=self._authorization(),
            accept={_NOT_THERE},
        )
        return answer.status != _NOT_THERE

    def _begin_upload(self, name: str, size: int) -> str:
        """Begin a resumable upload; return its address."""
        query = urlencode({"uploadType": "resumable", "name": self._prefix + name})
        answer = self._client.request(
            "POST",
            f"{self._server}/upload/storage/v1/b/{self._bucket}/o?{query}",
            attempt=f"upload {name}",
            headers={
                **self._authorization(needed=True),
                "X-Upload-Content-Type": "application/gzip",
                "X-Upload-Content-Length": str(size),
            },
        )
        return answer.headers.get("Location", "")

    def _send(
        self,
        stream: IO[bytes],
        session: str,
        name: str,
        size: int,
        progress: ProgressCallback | None,
    ) -> Mapping[str, Any]:
        """Send missing parts until the server has all of them.

        Raises:
            StorageError: the server accepts parts without storing any of them.
        """
        offset = farthest = idle = 0
        while idle < IDLE_ANSWERS:
            stream.seek(offset)
            part = stream.read(PART)
            last = offset + len(part) - 1
            span = f"{offset}-{last}" if part else "*"
            answer = self._client.request(
                "PUT",
                session,
                attempt=f"upload {name}",
                body=lambda part=part: part,  # type: ignore[misc]
                headers={"Content-Range": f"bytes {span}/{size}"},
                accept={_GO_ON},
            )
            arrived = answer.headers.get("Range", "").rpartition("-")[2]
            offset = whole_number(arrived, -1) + 1
            is_complete = answer.status != _GO_ON
            if progress:
                progress(size if is_complete else offset, size)
            if is_complete:
                return self._client.data(answer)
            idle = 0 if offset > farthest else idle + 1
            farthest = max(farthest, offset)
        raise StorageError(
            f"{self._client.name}: cannot upload {name}: the server has accepted the part from "
            f"byte {offset} {IDLE_ANSWERS} times without storing it. Check a proxy on the way to "
            "the server, then repeat the command."
        )

    def _authorization(self, *, needed: bool = False) -> dict[str, str]:
        """Header with an access token; empty without a key, which public buckets do not need."""
        key = _key()
        if key is None:
            if needed:
                raise InputError(
                    f"the share `gcs` needs the key of a service account for this: set {KEY_FILE} "
                    f"or {KEY_JSON}, in the environment or a `.env` file."
                )
            return {}
        if time.monotonic() > self._token_ends - 60:
            self._token, life = self._fetch_token(key)
            self._token_ends = time.monotonic() + life
        return {"Authorization": f"Bearer {self._token}"}

    def _fetch_token(self, key: Mapping[str, Any]) -> tuple[str, float]:
        assertion = _assertion(key)
        form = {
            "grant_type": "urn:ietf:params:oauth:grant-type:jwt-bearer",
            "assertion": assertion,
        }
        client = HttpClient(
            urlsplit(str(key["token_uri"])).netloc,
            {},
            remedies={400: f"Check the key in {KEY_FILE}.", 401: f"Check the key in {KEY_FILE}."},
            secrets=[assertion],
        )
        answer = client.request(
            "POST",
            str(key["token_uri"]),
            attempt="get an access token",
            body=lambda: urlencode(form).encode(),
            headers={"Content-Type": "application/x-www-form-urlencoded"},
        )
        data = client.data(answer)
        return str(data.get("access_token")), float(data.get("expires_in") or _TOKEN_LIFE)

    @cached_property
    def _client(self) -> HttpClient:
        name = f"gs://{os.environ.get(BUCKET, '')}"
        return HttpClient(
            name,
            {},
            remedies={
                401: f"Reading needs a public bucket or a key in {KEY_FILE}.",
                403: "The account needs the roles Storage Object Creator (to upload) and Storage "
                "Object Viewer (to list and download).",
                404: f"Check {BUCKET}.",
            },
        )

    @property
    def _server(self) -> str:
        emulator = os.environ.get(EMULATOR, "")
        if emulator and "://" not in emulator:
            return f"http://{emulator}"
        return emulator or _SERVER

    @property
    def _bucket(self) -> str:
        return quote(os.environ[BUCKET], safe="")

    @property
    def _prefix(self) -> str:
        return os.environ.get(PREFIX, "")

    @property
    def _api(self) -> str:
        return f"{self._server}/storage/v1/b/{self._bucket}"

    def _object(self, name: str) -> str:
        return f"{self._api}/o/{quote(self._prefix + name, safe='')}"


def _key() -> dict[str, Any] | None:
    """The service account's key from the variables."""
    text, path = os.environ.get(KEY_JSON), os.environ.get(KEY_FILE)
    if not text and not path:
        return None
    try:
        key = json.loads(text or read_text(Path(str(path)).expanduser()))
        return {name: key[name] for name in ("client_email", "private_key", "token_uri")}
    except InputError as error:
        raise InputError(f"{KEY_FILE}: {error}") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(
            f"{KEY_JSON if text else KEY_FILE} contains no key of a service account. The key is a "
            "JSON file with `client_email`, `private_key` and `token_uri`, created in Google's "
            "console."
        ) from None


def _assertion(key: Mapping[str, Any]) -> str:
    """The signed assertion for Google's token service (RFC 7523)."""
    with SHARE.needed_by("The share `gcs`"):
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric.padding import PKCS1v15
        from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey
    try:
        private = serialization.load_pem_private_key(str(key["private_key"]).encode(), None)
    except (ValueError, TypeError):
        raise InputError(f"the `private_key` in {KEY_FILE} or {KEY_JSON} is damaged.") from None
    if not isinstance(private, RSAPrivateKey):
        raise InputError(f"the `private_key` in {KEY_FILE} or {KEY_JSON} is not a valid RSA key.")
    now = int(time.time())
    claims = {
        "iss": key["client_email"],
        "scope": _SCOPE,
        "aud": key["token_uri"],
        "iat": now,
        "exp": now + _TOKEN_LIFE,
    }
    signed = ".".join(_base64(json.dumps(item).encode()) for item in (_HEADER, claims))
    signature = private.sign(signed.encode(), PKCS1v15(), hashes.SHA256())
    return f"{signed}.{_base64(signature)}"


_HEADER = {"alg": "RS256", "typ": "JWT"}


def _base64(content: bytes) -> str:
    return base64.urlsafe_b64encode(content).rstrip(b"=").decode()


def _md5(path: Path) -> str:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, lambda: hashlib.md5(usedforsecurity=False)).digest()
    return base64.b64encode(digest).decode()
