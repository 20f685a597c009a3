"""A server that always gives the same answer ends every operation, whatever the answer is."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from support.campaigns.owner import OWNER

from robovast.agent import bucket as bucket_module
from robovast.agent.bucket import Bucket
from robovast.base.backoff import Pauses
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore
from robovast.storage.shares import gcs
from robovast.storage.shares.gcs import GcsShareProvider
from robovast.storage.shares.webdav import WebDavShareProvider

MOST = 500
"""Most requests of one operation."""
TOKEN = b'{"access_token": "t", "expires_in": 3600, "nextPageToken": "p", "items": []}'
LIST = (
    b"<ListBucketResult><Name>b</Name><IsTruncated>true</IsTruncated>"
    b"<NextContinuationToken>t</NextContinuationToken><Contents><Key>a</Key><Size>1</Size>"
    b"<LastModified>2026-01-01T00:00:00Z</LastModified><ETag>e</ETag></Contents></ListBucketResult>"
)
REFUSED = b"<Error><Code>PreconditionFailed</Code></Error>"
BODIES = st.sampled_from([b"", b"x" * 100, TOKEN, LIST, REFUSED, b"<a/>"])
STATUSES = st.sampled_from([200, 201, 204, 206, 207, 308, 400, 404, 409, 412, 416, 429, 500, 503])
HEADERS = st.dictionaries(
    st.sampled_from(["Range", "Content-Range", "ETag", "Retry-After", "x-amz-meta-sha256"]),
    st.sampled_from(["bytes=0-0", "bytes 0-4/10", "bytes */10", '"e"', "0"]),
    max_size=3,
)


class Server:
    """Gives one answer to all requests, except for access tokens."""

    def __init__(self) -> None:
        self.status, self.body = 200, b""
        self.headers: Mapping[str, str] = {}
        self.requests = 0
        self.url = ""


@contextmanager
def served() -> Iterator[Server]:
    state = Server()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def handle_one_request(self) -> None:
            if state.requests > MOST:
                self.close_connection = True
                self.connection.close()
                return
            super().handle_one_request()

        def answer(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length") or 0))
            state.requests += 1
            token = self.path.startswith("/token")
            status, body = (200, TOKEN) if token else (state.status, state.body)
            self.send_response(status)
            for name, value in state.headers.items():
                self.send_header(name, value)
            self.send_header("Location", f"{state.url}/session")
            self.send_header("Last-Modified", "Thu, 01 Jan 2026 00:00:00 GMT")
            if status != 204:
                self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            if self.command != "HEAD" and status != 204:
                self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    for method in ("GET", "PUT", "POST", "HEAD", "DELETE", "PROPFIND", "MKCOL", "MOVE"):
        setattr(Handler, f"do_{method}", Handler.answer)
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    state.url = f"http://127.0.0.1:{server.server_port}"
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()


def share_operations(archive: Path, kind: type) -> list[Callable[[], object]]:
    return [
        lambda: kind().upload_archive(str(archive), "c.tar.gz"),
        lambda: kind().list_campaign_archives_with_size(),
        lambda: kind().download_archive("c.tar.gz", f"{archive}.new"),
        lambda: kind().download_archive("c.tar.gz", f"{archive}.new", None, 5),
        lambda: kind().archive_exists_on_share("c.tar.gz"),
        lambda: kind().remove_archive("c.tar.gz"),
    ]


def store_operations(url: str, folder: Path) -> list[Callable[[], object]]:
    keys = Credentials("key", "secret")
    store = ObjectStore(Endpoint.parse(url, "us-east-1"), keys, patience=0.2)
    bucket = Bucket(store, "b-1", OWNER)
    return [
        store.buckets,
        lambda: store.make_bucket("b-1"),
        lambda: store.delete_bucket("b-1"),
        lambda: list(store.objects("b-1", "a")),
        lambda: store.folders("b-1"),
        lambda: store.put_bytes("b-1", "a", b"content"),
        lambda: store.create("b-1", "a", b"content"),
        lambda: store.replace("b-1", "a", b"content", "e"),
        lambda: store.look("b-1", "a"),
        lambda: bucket.first_free_job(1),
        lambda: bucket.claim_job(1, 1, b"content"),
    ]


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with served() as state:
        yield state


@pytest.fixture(scope="module")
def key() -> str:
    """The key of a service account."""
    pem = rsa.generate_private_key(65537, 2048).private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    return pem.decode()


@settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(STATUSES, BODIES, HEADERS)
@example(308, b"", {})
@example(200, TOKEN, {})
@example(200, LIST, {})
@example(206, b"x" * 5, {"Content-Range": "bytes 0-4/10"})
@example(412, REFUSED, {})
@example(416, b"", {"Content-Range": "bytes */10"})
def test_every_operation_ends(
    server: Server,
    key: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    status: int,
    body: bytes,
    headers: dict[str, str],
) -> None:
    monkeypatch.setattr(Pauses, "wait", _few_pauses)
    monkeypatch.setattr(gcs, "PATIENCE", 0.2)
    monkeypatch.setattr(bucket_module, "MOST_JOBS", 50)
    account = {"client_email": "a@b", "private_key": key, "token_uri": f"{server.url}/token"}
    for name, value in {
        "ROBOVAST_GCS_BUCKET": "b",
        "STORAGE_EMULATOR_HOST": server.url,
        "ROBOVAST_GCS_KEY_JSON": json.dumps(account),
        "ROBOVAST_WEBDAV_URL": f"{server.url}/dav",
        "ROBOVAST_WEBDAV_USER": "u",
        "ROBOVAST_WEBDAV_PASSWORD": "p",
    }.items():
        monkeypatch.setenv(name, value)
    archive = tmp_path / "c.tar.gz"
    archive.write_bytes(b"x" * 1000)
    server.status, server.body, server.headers = status, body, headers
    for action in (
        *share_operations(archive, GcsShareProvider),
        *share_operations(archive, WebDavShareProvider),
        *store_operations(server.url, tmp_path),
    ):
        server.requests = 0
        with suppress(Exception):  # how it ends is tested elsewhere
            action()
        assert server.requests <= MOST


def _few_pauses(pauses: Pauses, at_least: float = 0.0) -> bool:
    """Wait for no time, and as often as `Pauses` would; `reset` gives it all attempts again."""
    del at_least
    if pauses._longest > 2.0:
        return False
    pauses._longest *= 2
    return True
