"""The gate before fake-gcs-server: it checks accounts, as Google does, and spoils uploads."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

TOKEN = "gcs-token"
UNIT = 2**18
"""Parts of uploads are stored in multiples of this [byte]."""
METADATA = {
    "/computeMetadata/v1/project/project-id": "a-project",
    "/computeMetadata/v1/universe/universe-domain": "googleapis.com",
    "/computeMetadata/v1/instance/service-accounts/default/": '{"email": "a@b", "scopes": []}',
    "/computeMetadata/v1/instance/service-accounts/default/token": (
        f'{{"access_token": "{TOKEN}", "expires_in": 3600, "token_type": "Bearer"}}'
    ),
}
"""What the metadata server of Google's machines answers."""


@dataclass
class Gate:
    """What it demands, and what it shall do wrong."""

    server: str
    """HOST:PORT of the server behind it."""
    address: str = ""
    """Its own HOST:PORT."""
    permissions: list[str] = field(default_factory=lambda: ["storage.objects.create"])
    public: bool = False
    denies_keys: bool = False
    halves: int = 0
    """So many parts of uploads are stored by half, which the answer states."""
    stores_nothing: bool = False
    """Parts are accepted, and dropped."""
    damages: bool = False
    """The last byte of each part is changed."""
    assertions: list[str] = field(default_factory=list)
    log: list[str] = field(default_factory=list)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"

    def log_message(self, *_: Any) -> None:
        """Be silent."""

    def _handle(self) -> None:
        gate = self.server.gate
        size = int(self.headers.get("Content-Length") or 0)
        body = self.rfile.read(size)
        path = urlsplit(self.path).path
        gate.log.append(f"{self.command} {path}")
        allowed = self.headers.get("Authorization") == f"Bearer {TOKEN}"
        if len(body) < size:  # the connection was cut
            self.close_connection = True
        elif path == "/token":
            gate.assertions += parse_qs(body.decode()).get("assertion", [])
            given = {"access_token": TOKEN, "expires_in": 3600}
            denied = {"error": "invalid_grant", "error_description": "Invalid JWT Signature."}
            answer = (400, denied) if gate.denies_keys else (200, given)
            self._answer(answer[0], json.dumps(answer[1]).encode())
        elif path == "/" or path in METADATA:
            content = METADATA.get(path, "")
            kind = "application/json" if content.startswith("{") else "application/text"
            headers = {"Metadata-Flavor": "Google", "Content-Type": kind}
            self._answer(200, content.encode(), headers)
        elif not allowed and not (gate.public and self.command == "GET"):
            self._answer(401, b'{"error": {"code": 401, "message": "Anonymous caller"}}')
        elif path.endswith("/iam/testPermissions"):
            self._answer(200, json.dumps({"permissions": gate.permissions}).encode())
        elif "Content-Range" in self.headers:
            self._pass_part(body)
        else:
            self._pass(body, self.headers)

    do_GET = do_POST = do_PUT = do_DELETE = _handle  # noqa: N815

    def _pass_part(self, body: bytes) -> None:
        gate, headers = self.server.gate, {k.title(): v for k, v in self.headers.items()}
        half = len(body) // 2 // UNIT * UNIT
        if gate.stores_nothing:
            self._answer(308, b"")
            return
        if gate.damages and body:
            body = body[:-1] + bytes([body[-1] ^ 1])
        if gate.halves and half:
            gate.halves -= 1
            body = body[:half]
            span, _, total = headers["Content-Range"].removeprefix("bytes ").partition("/")
            first = int(span.partition("-")[0])
            headers["Content-Range"] = f"bytes {first}-{first + half - 1}/{total}"
            headers["Content-Length"] = str(half)
        self._pass(body, headers)

    def _pass(self, body: bytes, headers: Mapping[str, str]) -> None:
        """Hand a request on. Its `Host` stays, of which the server makes the addresses it gives."""
        connection = HTTPConnection(self.server.gate.server, timeout=60)
        connection.request(self.command, self.path, body, {**headers, "Connection": "close"})
        answer = connection.getresponse()
        kept = {name: value for name, value in answer.getheaders() if name not in _OF_A_HOP}
        self._answer(answer.status, answer.read(), kept)
        connection.close()

    def _answer(
        self, status: int, content: bytes, headers: Mapping[str, str] | None = None
    ) -> None:
        self.send_response(status)
        for name, value in {**(headers or {}), "Content-Length": str(len(content))}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)


_OF_A_HOP = ("Connection", "Content-Length", "Date", "Server", "Transfer-Encoding")


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    gate: Gate

    def handle_error(self, *_: Any) -> None:
        """A connection that was cut is no news."""


@contextmanager
def gcs_gate(behind: str) -> Iterator[Gate]:
    """A gate before HOST:PORT."""
    with _Server(("127.0.0.1", 0), _Handler) as server:
        server.gate = Gate(behind, f"127.0.0.1:{server.server_address[1]}")
        thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        try:
            yield server.gate
        finally:
            server.shutdown()
            thread.join()
