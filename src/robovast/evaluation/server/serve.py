"""Runs the server until it is interrupted."""

from __future__ import annotations

import asyncio
import logging
import secrets
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Thread
from types import FrameType

import uvicorn
from starlette.types import ASGIApp

from robovast.base.errors import InputError
from robovast.evaluation.library import Library
from robovast.evaluation.notebooks.runner import TIMEOUT, Runner
from robovast.evaluation.server.app import make_app
from robovast.evaluation.server.connections import Connection
from robovast.evaluation.server.launches import LaunchPages, Starting
from robovast.evaluation.server.live import versions
from robovast.evaluation.server.notebooks import NotebookPages
from robovast.evaluation.server.preparing import Preparation

HOST = "127.0.0.1"
GRACE = 10
"""How long requests under way may take to be answered when the server ends [s]."""


def serve(
    library: Library,
    port: int | None,
    ready: Callable[[str], None],
    *,
    starting: Starting,
    override: Path | None = None,
    notebook_timeout: float = TIMEOUT,
    preparation: Preparation | None = None,
) -> None:
    """Show campaigns until Ctrl-C.

    Args:
        library: the campaigns.
        port: port on the loopback interface; None means any free port.
        ready: called with the page's address once the server accepts requests.
        starting: settings for starting campaigns from the page.
        override: a .vast file whose notebooks replace each campaign's own.
        notebook_timeout: time limit for all cells of a notebook [s].
        preparation: makes tables once the page is there, and ends with the server.

    Raises:
        InputError: the folder cannot be read, or the port is taken.
    """
    library.names()
    closing = asyncio.Event()
    runner = Runner(notebook_timeout)
    notebooks = NotebookPages(library, runner, override)
    launches = LaunchPages(library.results, starting, override)

    def make(token: str) -> ASGIApp:
        Thread(target=versions, args=(library,), daemon=True, name="read-ahead").start()
        return make_app(library, notebooks, launches, token, closing, preparation)

    def is_ready(address: str) -> None:
        ready(address)
        if preparation:
            preparation.start()

    def ending() -> None:
        closing.set()
        runner.close()

    def ended() -> None:
        launches.end()
        if preparation:
            preparation.end()

    serve_app(make, port, is_ready, ending, ended)


def serve_app(
    make: Callable[[str], ASGIApp],
    port: int | None,
    ready: Callable[[str], None],
    ending: Callable[[], None] = lambda: None,
    ended: Callable[[], None] = lambda: None,
) -> None:
    """Serve an application until Ctrl-C.

    Args:
        make: makes it from the secret that is the first part of its paths, when the port is had.
        port: port on the loopback interface; None means any free port.
        ready: called with the address once the server accepts requests.
        ending: called when the server is asked to end.
        ended: called when it accepts no more requests.

    Raises:
        InputError: the port is taken.
    """
    with _listen(port) as listener, suppress(KeyboardInterrupt):
        token = secrets.token_urlsafe(24)
        config = uvicorn.Config(
            make(token),
            log_level="debug" if logging.getLogger().isEnabledFor(logging.DEBUG) else "critical",
            access_log=False,
            server_header=False,
            lifespan="off",
            http=Connection,
            ws="none",
            timeout_graceful_shutdown=GRACE,
        )

        def started() -> None:
            ready(f"http://{HOST}:{_port(listener)}/{token}/")

        _Server(config, started, ending, ended).run(sockets=[listener])


class _Server(uvicorn.Server):
    """Reports when it is ready and when it is asked to end, so that nothing delays its end."""

    def __init__(
        self,
        config: uvicorn.Config,
        started: Callable[[], None],
        ending: Callable[[], None],
        ended: Callable[[], None],
    ) -> None:
        super().__init__(config)
        self._started = started
        self._ending = ending
        self._ended = ended

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start accepting requests."""
        await super().startup(sockets)
        self._started()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop accepting requests; meanwhile signals do not end the process."""
        await super().shutdown(sockets)
        await asyncio.to_thread(self._ended)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End."""
        self._ending()
        super().handle_exit(sig, frame)


def _listen(port: int | None) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port or 0))
    except OSError as error:
        listener.close()
        raise InputError(
            f"Port {port} cannot be used: {error.strerror}",
            hint="name another with `--port`, or none at all",
        ) from None
    return listener


def _port(listener: socket.socket) -> int:
    return int(listener.getsockname()[1])
