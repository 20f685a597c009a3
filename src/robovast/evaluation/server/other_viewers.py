"""Recordings for other viewers: Rerun, which is served with it, and apps that read MCAP.

A viewer gets the recording alone, at an address that holds a secret, and from Rerun's page
nothing goes to another host: the page asks for fonts and reports what its user does.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from robovast.base.signals import unwound_by_signals
from robovast.evaluation.server.answers import send_file
from robovast.evaluation.server.guard import LOOPBACK, RequestGuard
from robovast.evaluation.server.rerun import RECORDING, Viewer, viewer
from robovast.evaluation.server.serve import serve_app

_POLICY = "; ".join(
    (
        "default-src 'self' data: blob:",
        "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'",
        "style-src 'self' 'unsafe-inline'",
        "frame-ancestors 'none'",
    )
)
"""Of Rerun's page, which has scripts and styles in its HTML."""
_TYPES = {"": "text/html", ".js": "text/javascript", ".wasm": "application/wasm"}


def open_in_rerun(
    results: Path, bag: str, name: str, port: int | None, ready: Callable[[str, list[str]], None]
) -> None:
    """Show a bag in Rerun's page until Ctrl-C.

    Args:
        results: the results folder.
        bag: the bag's folder, relative to it.
        name: what the page calls it.
        port: port on the loopback interface; None means any free port.
        ready: called with the page's address and what the bag lacks.

    Raises:
        InputError: the bag cannot be read, or the port is taken.
        CannotRunError: Rerun is not installed or does not start.
    """
    faults: list[str] = []

    def make(stack: ExitStack, folder: Path) -> Callable[[str], ASGIApp]:
        path, lacking = _whole(results, bag, folder)
        faults.extend(lacking)
        return _rerun_app(stack.enter_context(viewer(path, name, folder)))

    def started(address: str) -> None:
        ready(f"{address}?url={quote(address + RECORDING, safe='')}", faults)

    _serve(make, port, started)


def serve_mcap(
    results: Path, bag: str, name: str, port: int | None, ready: Callable[[str, list[str]], None]
) -> None:
    """Serve a bag as one MCAP file until Ctrl-C, to apps and pages that take its address.

    Args:
        results: the results folder.
        bag: the bag's folder, relative to it.
        name: the file's name.
        port: port on the loopback interface; None means any free port.
        ready: called with the file's address and what the bag lacks.

    Raises:
        InputError: the bag cannot be read, or the port is taken.
    """
    faults: list[str] = []

    def make(_: ExitStack, folder: Path) -> Callable[[str], ASGIApp]:
        path, lacking = _whole(results, bag, folder)
        faults.extend(lacking)
        return _file_app(path, name)

    _serve(make, port, lambda address: ready(address + quote(name), faults))


def _serve(
    make: Callable[[ExitStack, Path], Callable[[str], ASGIApp]],
    port: int | None,
    ready: Callable[[str], None],
) -> None:
    """Serve an application that needs a folder, which is removed whatever ends the server."""
    with unwound_by_signals(), ExitStack() as stack:

        def made(token: str) -> ASGIApp:
            folder = stack.enter_context(TemporaryDirectory(prefix="robovast-view-"))
            return make(stack, Path(folder))(token)

        serve_app(made, port, ready, ended=stack.close)


def _whole(results: Path, bag: str, folder: Path) -> tuple[Path, list[str]]:
    """The bag as one file; packages for bags are needed only now."""
    from robovast.evaluation.drive.one_file import one_file

    return one_file(results, bag, folder)


def _rerun_app(viewer: Viewer) -> Callable[[str], ASGIApp]:
    """Rerun's page and its recording, below a secret."""

    def recording(request: Request) -> Response:
        return send_file(viewer.recording.open("rb"), RECORDING, request.headers.get("range"))

    def page(request: Request) -> Response:
        name = request.path_params["name"]
        content = viewer.page(name)
        if content is None:
            return PlainTextResponse("There is no such page.", 404)
        headers = {"content-security-policy": _POLICY}
        return Response(content, headers=headers, media_type=_TYPES.get(Path(name).suffix))

    app = Starlette(routes=[Route(f"/{RECORDING}", recording), Route("/{name:path}", page)])
    return lambda token: RequestGuard(app, token)


def _file_app(path: Path, name: str) -> Callable[[str], ASGIApp]:
    """A file, below a secret, for pages of any site that its user gives the address."""

    def make(token: str) -> ASGIApp:
        def answer(request: Request) -> Response:
            given: Mapping[str, str] = request.path_params
            if not secrets.compare_digest(given["token"].encode(), token.encode()):
                return PlainTextResponse("Open the address that was printed.", 403)
            return send_file(path.open("rb"), name, request.headers.get("range"))

        shared = Middleware(
            CORSMiddleware,
            allow_origins=["*"],
            allow_headers=["range"],
            allow_private_network=True,
            expose_headers=["accept-ranges", "content-length", "content-range"],
        )
        local = Middleware(TrustedHostMiddleware, allowed_hosts=LOOPBACK)
        return Starlette(routes=[Route("/{token}/{name}", answer)], middleware=[local, shared])

    return make
