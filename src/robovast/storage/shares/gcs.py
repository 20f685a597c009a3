"""Shares in Google Cloud Storage, by Google's own client."""

from __future__ import annotations

import json
import logging
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import IO, Any, ClassVar, TypeVar
from urllib.parse import quote

import google.auth
import requests
from google.api_core.exceptions import GoogleAPIError
from google.api_core.retry import Retry
from google.auth.credentials import AnonymousCredentials, Credentials
from google.auth.exceptions import (
    DefaultCredentialsError,
    GoogleAuthError,
    RefreshError,
    TransportError,
)
from google.auth.transport.requests import AuthorizedSession, Request
from google.cloud.storage import Blob, Bucket, Client
from google.cloud.storage.retry import DEFAULT_RETRY
from google.oauth2.service_account import Credentials as ServiceAccount
from google.resumable_media import DataCorruption, InvalidResponse, RetryStrategy
from google.resumable_media.requests import ResumableUpload

from robovast.base.backoff import FIRST_CONTACT, LONGEST_PAUSE, TRANSFERRING
from robovast.base.errors import InputError, StorageError
from robovast.base.file_errors import read_text, writing
from robovast.storage.http_client import HttpError, refused, unreachable
from robovast.storage.shares.base import BaseShareProvider, ProgressCallback

S = TypeVar("S", bound=requests.Session)

BUCKET = "ROBOVAST_GCS_BUCKET"
PREFIX = "ROBOVAST_GCS_PREFIX"
KEY_FILE = "ROBOVAST_GCS_KEY_FILE"
KEY_JSON = "ROBOVAST_GCS_KEY_JSON"
EMULATOR = "STORAGE_EMULATOR_HOST"
"""Address of a server in place of Google's, with the name that Google's own libraries use."""
LOGIN_FILE = "GOOGLE_APPLICATION_CREDENTIALS"
"""File with a login, with the name that Google's own libraries use."""

PART = 8 * 2**20
"""Size of a request of a transfer [byte]; a multiple of 256 KiB."""
PAGE: int | None = None
"""Number of objects in a page of a list; the server's default if None."""
IDLE_ANSWERS = 3
"""Number of answers without progress after which an upload fails."""
PATIENCE = TRANSFERRING
"""Time limit of retries of a request [s]."""

_NO_METADATA = "DISABLE_GCS_PYTHON_CLIENT_OTEL_BUCKET_METADATA"
"""Variable that keeps Google's client from asking for the bucket's metadata in a thread."""
_SERVER = "https://storage.googleapis.com"
_SCOPES = ["https://www.googleapis.com/auth/devstorage.read_write"]
_RIGHT = "storage.objects.create"
_NOT_THERE = 404
_GO_ON = 308
_FAILURES = (GoogleAPIError, GoogleAuthError, InvalidResponse, requests.RequestException)
_REMEDIES = {
    401: f"Reading needs a public bucket, a key in {KEY_FILE}, or a login.",
    403: "The account needs the roles Storage Object Creator (to upload) and Storage Object Viewer "
    "(to list and download).",
    404: f"Check {BUCKET}.",
}


class GcsShareProvider(BaseShareProvider):
    """A bucket; reading a public one needs no account."""

    SHARE_TYPE: ClassVar[str] = "gcs"

    def __init__(self) -> None:
        self._has_answered = False

    def required_env_vars(self) -> dict[str, str]:
        """The bucket; an account is required only for uploading and removing."""
        return {BUCKET: "name of the bucket"}

    def build_pod_env(self) -> dict[str, str]:
        """The variables, with the key's content in place of its file."""
        names = (BUCKET, PREFIX, EMULATOR)
        env = {name: os.environ[name] for name in names if name in os.environ}
        key = _key()
        return {**env, **({KEY_JSON: json.dumps(key)} if key else {})}

    def verify_access(self) -> None:
        """Check that the account may upload."""
        self._require_account()
        with self._storage_errors("read the permissions of the account"):
            found = self._bucket.test_iam_permissions([_RIGHT], retry=self._retry)
        if _RIGHT not in found:
            raise StorageError(
                f"{self._name}: the account may not upload to the bucket",
                hint="give it the role Storage Object Creator",
            )

    def upload_archive(
        self,
        archive_path: str,
        object_name: str,
        progress_callback: ProgressCallback | None = None,
    ) -> None:
        """Upload an archive in parts; after an interruption, the rest is sent."""
        self._require_account()
        path = Path(archive_path)
        before = path.stat()
        is_whole = True
        try:
            with path.open("rb") as stream, self._storage_errors(f"upload {object_name}"):
                upload = self._begin(stream, object_name, before.st_size)
                self._send(upload, stream, object_name, progress_callback)
        except DataCorruption:
            is_whole = False
        after = path.stat()
        is_same = (after.st_size, after.st_mtime_ns) == (before.st_size, before.st_mtime_ns)
        if not (is_whole and is_same):  # the checksum is that of the sent bytes
            raise StorageError(
                f"{self._name}: {object_name} is damaged, or was changed during the upload",
                hint="upload it again",
            )

    def list_campaign_archives_with_size(self) -> list[tuple[str, int]]:
        """Archives directly below the prefix."""
        found: list[tuple[str, int]] = []
        seen: set[str | None] = set()
        with self._storage_errors("list the bucket"):
            blobs = self._bucket.client.list_blobs(
                self._bucket,
                prefix=self._prefix or None,
                delimiter="/",
                fields="items(name,size),nextPageToken",
                page_size=PAGE,
                retry=self._retry,
            )
            for page in blobs.pages:
                found += [(blob.name.removeprefix(self._prefix), blob.size) for blob in page]
                if blobs.next_page_token in seen:
                    raise StorageError(
                        f"{self._name}: cannot list the bucket: the server sends the same page "
                        "again and again",
                        hint="check a proxy on the way to the server",
                    )
                seen.add(blobs.next_page_token)
        return sorted((name, size) for name, size in found if name.endswith(".tar.gz"))

    def download_archive(
        self,
        object_name: str,
        dest: str,
        progress_callback: ProgressCallback | None = None,
        resume_offset: int = 0,
    ) -> None:
        """Download an archive in parts; after an interruption, the rest is downloaded."""
        path, found = Path(dest), self._blob(object_name)
        with self._storage_errors(f"look for {object_name}"):
            found.reload(retry=self._retry)
        # Another blob, which has no address of the server's choice.
        blob = self._bucket.blob(found.name, PART, generation=found.generation)
        with writing(path), path.open("r+b" if resume_offset and path.exists() else "wb") as file:
            file.seek(resume_offset)
            file.truncate()
            if resume_offset < found.size:
                with self._storage_errors(f"download {object_name}"):
                    blob.download_to_file(
                        _Arriving(file, found.size, progress_callback),
                        start=resume_offset,
                        raw_download=True,
                        checksum=None,
                        retry=self._retry,
                    )

    def remove_archive(self, name: str) -> None:
        """Remove an archive."""
        self._require_account()
        try:
            with self._storage_errors(f"remove {name}"):
                self._blob(name).delete(retry=self._retry)
        except HttpError as error:
            if error.status != _NOT_THERE:
                raise
            raise InputError(f"{self._name}: there is no {name}.") from None

    def archive_exists_on_share(self, name: str) -> bool:
        """Look for a single archive."""
        with self._storage_errors(f"look for {name}"):
            return bool(self._blob(name).exists(retry=self._retry))

    def _begin(self, stream: IO[bytes], name: str, size: int) -> ResumableUpload:
        """Begin a resumable upload."""
        server, bucket = self._bucket.client.api_endpoint, quote(self._bucket.name, safe="")
        address = f"{server}/upload/storage/v1/b/{bucket}/o?uploadType=resumable"
        upload = ResumableUpload(address, PART, checksum="md5")
        upload._retry_strategy = RetryStrategy(LONGEST_PAUSE, self._patience)
        metadata = {"name": self._prefix + name}
        upload.initiate(self._session, stream, metadata, "application/gzip", size)
        return upload

    def _send(
        self,
        upload: ResumableUpload,
        stream: IO[bytes],
        name: str,
        progress: ProgressCallback | None,
    ) -> None:
        """Send missing parts until the server has all of them.

        Raises:
            StorageError: the server accepts parts without storing any of them.
        """
        farthest = idle = 0
        while idle < IDLE_ANSWERS:
            stream.seek(upload.bytes_uploaded)
            try:
                upload.transmit_next_chunk(self._session)
            except InvalidResponse as error:
                if error.response.status_code != _GO_ON:
                    raise
                upload.recover(self._session)  # the answer does not state how much has arrived
            if progress:
                progress(upload.bytes_uploaded, upload.total_bytes)
            if upload.finished:
                return
            idle = 0 if upload.bytes_uploaded > farthest else idle + 1
            farthest = max(farthest, upload.bytes_uploaded)
        raise StorageError(
            f"{self._name}: cannot upload {name}: the server has accepted the part from byte "
            f"{upload.bytes_uploaded} {IDLE_ANSWERS} times without storing it",
            hint="check a proxy on the way to the server, then repeat the command",
        )

    @contextmanager
    def _storage_errors(self, attempt: str) -> Iterator[None]:
        """Wrap requests; their errors become those of RoboVAST.

        Raises:
            HttpError: the server refused.
            StorageError: it cannot be reached.
        """
        try:
            yield
        except _FAILURES as error:
            raise self._failure(f"{self._name}: cannot {attempt}", error) from error
        self._has_answered = True

    def _failure(self, start: str, error: Exception) -> StorageError:
        error = getattr(error, "cause", None) or error  # of the last retry
        key = _key()
        if isinstance(error, RefreshError):
            place = f"the key in {KEY_FILE}" if key else "the login"
            said = " ".join(str(next(iter(error.args), "")).split())
            return HttpError(
                f"{start}: there is no access token ({said})", 401, hint=f"check {place}"
            )
        answer = getattr(error, "response", None)
        if answer is not None and answer.status_code >= 300:
            return refused(start, answer.status_code, answer.headers, answer.content, _REMEDIES)
        address = key["token_uri"] if key and isinstance(error, TransportError) else _server()
        return unreachable(start, address, _innermost(error))

    def _require_account(self) -> None:
        if isinstance(self._session.credentials, AnonymousCredentials):
            raise InputError(
                "the share `gcs` needs an account for this",
                hint=f"set the key of a service account in {KEY_FILE} or {KEY_JSON}, in the "
                "environment or a `.env` file, or log in with `gcloud auth "
                "application-default login`",
            )

    @property
    def _patience(self) -> float:
        return PATIENCE if self._has_answered else min(PATIENCE, FIRST_CONTACT)

    @property
    def _retry(self) -> Retry:
        retry: Retry = DEFAULT_RETRY.with_timeout(self._patience)
        return retry.with_delay(maximum=LONGEST_PAUSE)

    @cached_property
    def _session(self) -> AuthorizedSession:
        account = _credentials()
        renewed = () if isinstance(account, AnonymousCredentials) else (401,)
        tokens = Request(_careful(requests.Session()))
        return _careful(AuthorizedSession(account, renewed, auth_request=tokens))

    @cached_property
    def _bucket(self) -> Bucket:
        os.environ.setdefault(_NO_METADATA, "true")
        client = Client(
            None,
            self._session.credentials,
            self._session,
            client_options={"api_endpoint": _server()} if EMULATOR in os.environ else None,
        )
        return client.bucket(os.environ[BUCKET])

    def _blob(self, name: str) -> Blob:
        return self._bucket.blob(self._prefix + name)

    @property
    def _name(self) -> str:
        return f"gs://{os.environ.get(BUCKET, '')}"

    @property
    def _prefix(self) -> str:
        return os.environ.get(PREFIX, "")


class _Arriving:
    """A file that a download writes, with progress."""

    def __init__(self, file: IO[bytes], size: int, progress: ProgressCallback | None) -> None:
        self._file = file
        self._size = size
        self._progress = progress

    def write(self, content: bytes) -> None:
        """Write what has arrived."""
        self._file.write(content)
        if self._progress:
            self._progress(self._file.tell(), self._size)


def _credentials() -> Credentials:
    """The account of the key, else of a login or of the machine; an anonymous one if there is none.

    Raises:
        InputError: the key or the login cannot be used.
    """
    key = _key()
    if key is not None:
        try:
            account: Credentials = ServiceAccount.from_service_account_info(key, scopes=_SCOPES)
        except (ValueError, TypeError):
            raise InputError(
                f"the `private_key` in {KEY_FILE} or {KEY_JSON} is damaged.",
                hint="create another key in Google's console",
            ) from None
        return account
    if os.environ.get(EMULATOR):
        return AnonymousCredentials()
    # Neither the absence of a metadata server nor of a project to bill is worth a warning.
    logging.getLogger("google.auth").setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            account, _ = google.auth.default(scopes=_SCOPES)
    except DefaultCredentialsError as error:
        if os.environ.get(LOGIN_FILE):
            raise InputError(f"{LOGIN_FILE}: {error}") from None
        return AnonymousCredentials()
    return account


def _key() -> dict[str, Any] | None:
    """The service account's key from the variables."""
    text, path = os.environ.get(KEY_JSON), os.environ.get(KEY_FILE)
    if not text and not path:
        return None
    try:
        key = json.loads(text or read_text(Path(str(path)).expanduser()))
        return {name: key[name] for name in ("client_email", "private_key", "token_uri")}
    except InputError as error:
        raise InputError(f"{KEY_FILE}: {error.message}", hint=error.hint) from None
    except (ValueError, KeyError, TypeError):
        raise InputError(
            f"{(KEY_JSON if text else KEY_FILE)} contains no key of a service account",
            hint="create a key in Google's console: a JSON file with `client_email`, "
            "`private_key` and `token_uri`",
        ) from None


def _careful(session: S) -> S:
    """A session that trusts the same certificates as all of RoboVAST, and is never redirected."""
    session.verify = os.environ.get("SSL_CERT_FILE") or True
    session.max_redirects = 0
    return session


def _server() -> str:
    emulator = os.environ.get(EMULATOR, "")
    if emulator and "://" not in emulator:
        return f"http://{emulator}"
    return emulator or _SERVER


def _innermost(error: BaseException) -> BaseException:
    """The cause within exceptions that wrap one another."""
    inner = getattr(error, "reason", None) or next(iter(error.args), None)
    return _innermost(inner) if isinstance(inner, Exception) else error
