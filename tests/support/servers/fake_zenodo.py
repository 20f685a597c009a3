"""A server that speaks Zenodo's documented REST API for deposits, and misbehaves on request."""

from __future__ import annotations

import hashlib
import json
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

TOKEN = "zenodo-token-7f3a"


class Zenodo:
    """What the server knows, and what it shall do wrong."""

    def __init__(self) -> None:
        self.address = ""
        self.deposits: dict[int, dict[str, Any]] = {}
        self.contents: dict[int, dict[str, bytes]] = {}
        self.log: list[str] = []
        """`METHOD path` of every request that was answered."""
        self.faults: list[tuple[str, int, dict[str, str]]] = []
        """Method, status (0: cut the connection) and headers of answers in place of the right."""
        self.lose_answer_of: str = ""
        """Method whose next request is carried out, but not answered."""
        self.bucket_host = ""

    def requests(self, method: str) -> list[str]:
        """Paths of all requests of a method."""
        return [line.partition(" ")[2] for line in self.log if line.startswith(f"{method} ")]

    def fail(self, method: str, status: int, times: int = 1, **headers: str) -> None:
        """Answer the next requests of a method with an error, or cut them."""
        self.faults += [(method, status, headers)] * times

    def new(self) -> dict[str, Any]:
        """A new draft."""
        number = 1000 + len(self.deposits)
        bucket = self.bucket_host or self.address
        self.contents[number] = {}
        self.deposits[number] = {
            "id": number,
            "submitted": False,
            "state": "unsubmitted",
            "metadata": {"prereserve_doi": {"doi": f"10.5072/zenodo.{number}"}},
            "links": {
                "html": f"{self.address}/deposit/{number}",
                "bucket": f"{bucket}/api/files/bucket-{number}",
            },
        }
        return self.deposits[number]

    def shown(self, number: int) -> dict[str, Any]:
        """A deposit as it is answered."""
        files = [
            {"filename": name, "filesize": len(data), "checksum": hashlib.md5(data).hexdigest()}  # noqa: S324
            for name, data in self.contents[number].items()
        ]
        return {**self.deposits[number], "files": files}


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"

    def log_message(self, *_: Any) -> None:
        """Be silent."""

    def _handle(self) -> None:
        zenodo = self.server.zenodo
        fault = next((f for f in zenodo.faults if f[0] == self.command), None)
        if fault is not None:
            zenodo.faults.remove(fault)
            if fault[1] == 0:
                self.rfile.read(10)
                self.connection.close()
                self.close_connection = True
                return
        length = int(self.headers.get("Content-Length") or 0)
        body = self.rfile.read(length)
        if len(body) < length:  # the client has gone
            self.close_connection = True
            return
        zenodo.log.append(f"{self.command} {self.path}")
        if fault is not None:
            self._answer(fault[1], {"message": "as it was told"}, fault[2])
        elif self.headers.get("Authorization") != f"Bearer {TOKEN}":
            said = f"not authorized: {self.headers.get('Authorization')}"
            self._answer(401, {"status": 401, "message": said}, {})
        else:
            status, data = self._act(body)
            if zenodo.lose_answer_of == self.command:
                zenodo.lose_answer_of = ""
                self.connection.close()
                self.close_connection = True
                return
            self._answer(status, data, {})

    do_GET = do_POST = do_PUT = _handle  # noqa: N815

    def _act(self, body: bytes) -> tuple[int, dict[str, Any]]:
        zenodo = self.server.zenodo
        if self.path == "/api/deposit/depositions" and self.command == "POST":
            return 201, zenodo.new()
        match = re.fullmatch(r"/api/files/bucket-(\d+)/(.+)", self.path)
        if match and self.command == "PUT":
            name = match[2].replace("%20", " ")
            zenodo.contents[int(match[1])][name] = body
            return 200, {"key": name, "checksum": f"md5:{hashlib.md5(body).hexdigest()}"}  # noqa: S324
        match = re.fullmatch(r"/api/deposit/depositions/(\d+)(/actions/publish)?", self.path)
        if match is None or int(match[1]) not in zenodo.deposits:
            return 404, {"message": "PID does not exist."}
        return self._act_on(int(match[1]), body)

    def _act_on(self, number: int, body: bytes) -> tuple[int, dict[str, Any]]:
        zenodo = self.server.zenodo
        deposit = zenodo.deposits[number]
        if self.command == "POST":
            deposit.update(submitted=True, state="done", doi=f"10.5072/zenodo.{number}")
            return 202, zenodo.shown(number)
        if self.command == "PUT":
            deposit["metadata"] |= json.loads(body)["metadata"]
        return 200, zenodo.shown(number)

    def _answer(self, status: int, data: dict[str, Any], headers: dict[str, str]) -> None:
        content = json.dumps(data).encode()
        self.send_response(status)
        for name, value in {"Content-Length": str(len(content)), **headers}.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        self.wfile.write(content)


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    zenodo: Zenodo

    def handle_error(self, *_: Any) -> None:
        """A connection that was cut is no news."""


@contextmanager
def zenodo_server() -> Iterator[Zenodo]:
    """A server on the loopback interface."""
    with _Server(("127.0.0.1", 0), _Handler) as server:
        server.zenodo = Zenodo()
        server.zenodo.address = f"http://127.0.0.1:{server.server_address[1]}"
        thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        try:
            yield server.zenodo
        finally:
            with suppress(OSError):
                server.shutdown()
            thread.join()
