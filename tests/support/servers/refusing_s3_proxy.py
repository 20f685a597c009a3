"""An S3 server that refuses some requests, in front of a real one."""

from __future__ import annotations

import http.client
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.parse import unquote

Refuses = Callable[[str, str], tuple[int, str] | None]
"""Status and code for the method and path of a request; None when it is passed on."""


@contextmanager
def refusing(server: str, refuses: Refuses) -> Iterator[str]:
    """Host and port of a server that stands before another one, by host and port."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def _answer(self) -> None:
            length = int(self.headers.get("Content-Length") or 0)
            body = self.rfile.read(length)
            refused = refuses(self.command, unquote(self.path.partition("?")[0]))
            if refused is None:
                self._pass_on(body)
                return
            status, code = refused
            text = f"<Error><Code>{code}</Code><Message>it does not</Message></Error>".encode()
            self._send(status, [("Content-Type", "application/xml")], text)

        def _pass_on(self, body: bytes) -> None:
            there = http.client.HTTPConnection(server, timeout=60)
            there.request(self.command, self.path, body or None, dict(self.headers))
            answer = there.getresponse()
            kept = [(k, v) for k, v in answer.getheaders() if k.lower() not in _HOPS]
            self._send(answer.status, kept, answer.read(), answer.getheader("Content-Length"))
            there.close()

        def _send(
            self, status: int, headers: list[tuple[str, str]], body: bytes, size: str | None = None
        ) -> None:
            self.send_response(status)
            for name, value in headers:
                self.send_header(name, value)
            self.send_header("Content-Length", size or str(len(body)))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(body)

        do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = _answer  # noqa: N815

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as proxy:
        Thread(target=proxy.serve_forever, daemon=True).start()
        try:
            yield f"127.0.0.1:{proxy.server_port}"
        finally:
            proxy.shutdown()


_HOPS = frozenset({"connection", "content-length", "transfer-encoding", "server", "date"})
