"""Servers for shares on the loopback interface: real ones, and one that speaks GCS's JSON API."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

USER, PASSWORD = "tester", "pass word-92f"


@contextmanager
def webdav_server(
    root: Path,
    user: str = USER,
    password: str = PASSWORD,
    *,
    address: tuple[str, int] = ("127.0.0.1", 0),
) -> Iterator[str]:
    """WsgiDAV behind Cheroot; gives its address."""
    from cheroot import wsgi
    from wsgidav.wsgidav_app import WsgiDAVApp

    app = WsgiDAVApp(
        {
            "provider_mapping": {"/": str(root)},
            "simple_dc": {"user_mapping": {"*": {user: {"password": password}}}},
            "http_authenticator": {"accept_digest": False, "default_to_digest": False},
            "logging": {"enable": False},
            "verbose": 0,
            "dir_browser": {"enable": False},
        }
    )
    server = wsgi.Server(address, app)
    server.prepare()
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    try:
        yield f"{address[0]}:{server.bind_addr[1]}"
    finally:
        server.stop()
        thread.join()


@contextmanager
def webdav_process(root: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The same in a process of its own; gives that, and its address."""
    command = [sys.executable, __file__, root, "127.0.0.1", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    with process:
        try:
            assert process.stdout is not None
            yield process, process.stdout.readline().split()[-1]
        finally:
            process.kill()


@dataclass
class SftpServer:
    """An SSH server that only does SFTP."""

    port: int
    host_key: str
    """As in `known_hosts`, without the name."""
    client_key: str
    """Private key that it accepts, PEM."""


@contextmanager
def sftp_server(root: Path, address: tuple[str, int] = ("127.0.0.1", 0)) -> Iterator[SftpServer]:
    """asyncssh, confined to a folder."""
    import asyncssh

    host_key = asyncssh.generate_private_key("ssh-ed25519")
    client_key = asyncssh.generate_private_key("ssh-ed25519")

    connections: list[Any] = []

    class Account(asyncssh.SSHServer):
        def connection_made(self, conn: Any) -> None:
            connections.append(conn)

        def password_auth_supported(self) -> bool:
            return True

        def validate_password(self, username: str, password: str) -> bool:
            return (username, password) == (USER, PASSWORD)

        def validate_public_key(self, username: str, key: Any) -> bool:
            return username == USER and key == client_key.convert_to_public()

        def public_key_auth_supported(self) -> bool:
            return True

    def files(channel: Any) -> Any:
        return asyncssh.SFTPServer(channel, chroot=str(root))

    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()

    async def listen() -> Any:
        return await asyncssh.create_server(
            Account, *address, server_host_keys=[host_key], sftp_factory=files
        )

    server = asyncio.run_coroutine_threadsafe(listen(), loop).result(30)
    public = host_key.export_public_key().decode().strip()
    pem = client_key.export_private_key("openssh").decode()
    try:
        yield SftpServer(server.get_port(), public, pem)
    finally:
        asyncio.run_coroutine_threadsafe(_closed(server, connections), loop).result(30)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _closed(server: Any, connections: list[Any]) -> None:
    server.close()
    for connection in connections:
        connection.abort()
    await asyncio.gather(*(item.wait_closed() for item in connections))
    await server.wait_closed()


@dataclass
class Session:
    """An upload in parts."""

    name: str
    stored: bytearray = field(default_factory=bytearray)


@dataclass
class Gcs:
    """What the server that stands for Google's knows, and what it shall do wrong."""

    address: str = ""
    objects: dict[str, bytes] = field(default_factory=dict)
    sessions: dict[str, Session] = field(default_factory=dict)
    log: list[str] = field(default_factory=list)
    permissions: list[str] = field(default_factory=lambda: ["storage.objects.create"])
    public: bool = False
    cut_parts: int = 0
    """So many parts of uploads are taken by half, and then the connection is cut."""
    assertions: list[str] = field(default_factory=list)


class _GcsHandler(BaseHTTPRequestHandler):
    server: _GcsServer
    protocol_version = "HTTP/1.1"

    def log_message(self, *_: Any) -> None:
        """Be silent."""

    def _handle(self) -> None:
        gcs = self.server.gcs
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        url = urlsplit(self.path)
        query = {key: values[0] for key, values in parse_qs(url.query).items()}
        gcs.log.append(f"{self.command} {url.path}")
        if url.path == "/token":
            gcs.assertions.append(parse_qs(body.decode())["assertion"][0])
            self._answer(200, {"access_token": "gcs-token", "expires_in": 3600})
        elif url.path.startswith("/session/"):
            self._take_part(url.path.rpartition("/")[2], body)
        elif self.headers.get("Authorization") != "Bearer gcs-token" and not (
            gcs.public and self.command == "GET"
        ):
            self._answer(401, {"error": {"code": 401, "message": "Anonymous caller"}})
        else:
            self._act(url.path, query)

    do_GET = do_POST = do_PUT = do_DELETE = _handle  # noqa: N815

    def _act(self, path: str, query: dict[str, str]) -> None:
        gcs = self.server.gcs
        name = unquote(path.rpartition("/o/")[2]) if "/o/" in path else ""
        if path.endswith("/iam/testPermissions"):
            self._answer(200, {"permissions": gcs.permissions})
        elif path == "/upload/storage/v1/b/bucket/o":
            session = str(len(gcs.sessions))
            gcs.sessions[session] = Session(query["name"])
            self._answer(200, {}, {"Location": f"{gcs.address}/session/{session}"})
        elif path == "/storage/v1/b/bucket/o":
            self._list(query)
        elif name not in gcs.objects:
            self._answer(404, {"error": {"code": 404, "message": "No such object"}})
        elif self.command == "DELETE":
            del gcs.objects[name]
            self._answer(204, None)
        elif query.get("alt") == "media":
            self._send_object(gcs.objects[name])
        else:
            self._answer(200, {"name": name})

    def _list(self, query: dict[str, str]) -> None:
        """One object on each page."""
        found = sorted(n for n in self.server.gcs.objects if n.startswith(query["prefix"]))
        at = int(query.get("pageToken", 0))
        items = [
            {"name": name, "size": str(len(self.server.gcs.objects[name]))}
            for name in found[at : at + 1]
        ]
        more = {"nextPageToken": str(at + 1)} if at + 1 < len(found) else {}
        self._answer(200, {"items": items, **more})

    def _take_part(self, session: str, body: bytes) -> None:
        gcs = self.server.gcs
        name, stored = gcs.sessions[session].name, gcs.sessions[session].stored
        span, _, total = self.headers["Content-Range"].removeprefix("bytes ").partition("/")
        if span != "*":
            first = int(span.partition("-")[0])
            if gcs.cut_parts:
                gcs.cut_parts -= 1
                stored[first:] = body[: len(body) // 2]
                self.connection.shutdown(socket.SHUT_RDWR)
                self.close_connection = True
                return
            stored[first:] = body
        if len(stored) == int(total):
            content = bytes(stored)
            gcs.objects[name] = content
            digest = base64.b64encode(hashlib.md5(content).digest()).decode()  # noqa: S324
            self._answer(200, {"size": total, "md5Hash": digest})
        else:
            arrived = {"Range": f"bytes=0-{len(stored) - 1}"} if stored else {}
            self._answer(308, None, arrived)

    def _send_object(self, content: bytes) -> None:
        match = re.fullmatch(r"bytes=(\d+)-", self.headers.get("Range", ""))
        first = int(match[1]) if match else 0
        total = len(content)
        self.send_response(206 if match else 200)
        if match:
            self.send_header("Content-Range", f"bytes {first}-{total - 1}/{total}")
        self.send_header("Content-Length", str(total - first))
        self.end_headers()
        self.wfile.write(content[first:])

    def _answer(
        self, status: int, data: dict[str, Any] | None, headers: dict[str, str] | None = None
    ) -> None:
        content = b"" if data is None else json.dumps(data).encode()
        self.send_response(status)
        for name, value in {"Content-Length": str(len(content)), **(headers or {})}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)


class _GcsServer(ThreadingHTTPServer):
    daemon_threads = True
    gcs: Gcs

    def handle_error(self, *_: Any) -> None:
        """A connection that was cut is no news."""


@contextmanager
def gcs_server() -> Iterator[Gcs]:
    """A server that speaks the JSON API, as far as its documentation says."""
    with _GcsServer(("127.0.0.1", 0), _GcsHandler) as server:
        server.gcs = Gcs(f"http://127.0.0.1:{server.server_address[1]}")
        thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        try:
            yield server.gcs
        finally:
            server.shutdown()
            thread.join()


def serve(root: Path, host: str, port: int, sftp_port: int | None = None) -> None:
    """A WebDAV server, and one for SFTP when it has a port, until they are killed."""
    with ExitStack() as stack:
        if sftp_port is not None:
            server = stack.enter_context(sftp_server(root, (host, sftp_port)))
            print("host key", server.host_key, flush=True)
        print("serving", stack.enter_context(webdav_server(root, address=(host, port))), flush=True)
        threading.Event().wait()


if __name__ == "__main__":  # FOLDER HOST PORT [SFTP PORT]
    serve(Path(sys.argv[1]), sys.argv[2], *map(int, sys.argv[3:]))
