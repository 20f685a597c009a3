"""Runs the server: over standard input and output, or HTTP on the loopback interface."""

from __future__ import annotations

import secrets
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Literal

import anyio
from fastmcp import FastMCP
from fastmcp.server.auth import AccessToken, TokenVerifier
from fastmcp.server.middleware.logging import LoggingMiddleware

from robovast.mcp.loopback import listen
from robovast.mcp.server import make_server

HttpTransport = Literal["streamable-http", "sse"]

_PATHS: dict[HttpTransport, str] = {"streamable-http": "/mcp", "sse": "/sse"}


class OneToken(TokenVerifier):
    """Accepts a single token."""

    def __init__(self, token: str) -> None:
        super().__init__()
        self._token = token

    async def verify_token(self, token: str) -> AccessToken | None:
        """The permissions of a request's token; None if the token is wrong."""
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return None
        return AccessToken(token=token, client_id="user", scopes=[])


def serve_stdio(results: Path, debug: bool = False) -> None:
    """Serve a results folder until standard input ends, or Ctrl-C ends the process.

    Args:
        results: the results folder.
        debug: whether to log all messages to standard error.

    Raises:
        InputError: the folder cannot be read.
    """
    server = _server(results, None, debug)
    # A thread blocks on standard input, and nothing else would end it before the next line.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    anyio.run(lambda: server.run_stdio_async(show_banner=False, log_level=_level(debug)))


def serve_http(
    results: Path,
    address: tuple[str, int],
    token: str,
    ready: Callable[[str], None],
    transport: HttpTransport = "streamable-http",
    debug: bool = False,
) -> None:
    """Serve a results folder over HTTP until Ctrl-C.

    Args:
        results: the results folder.
        address: host, which must be this machine's loopback interface, and port; 0 for any free
            port.
        token: secret in the header of each request (`Authorization: Bearer …`).
        ready: called with the URL once the server accepts connections.
        transport: `streamable-http`, or `sse` for old clients.
        debug: whether to log all messages to standard error.

    Raises:
        InputError: the folder cannot be read, the host is not the loopback interface, or the port
            is taken.
    """
    server = _server(results, OneToken(token), debug)
    path = _PATHS[transport]
    with listen(*address) as listener, suppress(KeyboardInterrupt):
        host, port = listener.getsockname()[:2]
        ready(f"http://{f'[{host}]' if ':' in host else host}:{port}{path}")
        anyio.run(
            lambda: server.run_http_async(
                show_banner=False,
                transport=transport,
                path=path,
                host=host,
                port=port,
                sockets=[listener],
                host_origin_protection=True,
                log_level=_level(debug),
                uvicorn_config={
                    "log_level": "debug" if debug else "critical",
                    "access_log": False,
                    "server_header": False,
                    "limit_concurrency": 64,
                },
            )
        )


def _server(results: Path, auth: TokenVerifier | None, debug: bool) -> FastMCP:
    server = make_server(results, auth)
    if debug:
        server.add_middleware(LoggingMiddleware(include_payloads=True))
    return server


def _level(debug: bool) -> str:
    return "DEBUG" if debug else "WARNING"
