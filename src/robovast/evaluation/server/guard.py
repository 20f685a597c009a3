"""Protects the server: checks all requests and adds headers to all responses.

The page shows untrusted files on a machine whose browser also visits other sites. Therefore it
requires a secret token in the path and a Host of this machine (other sites may let their names
resolve to it), refuses requests of other origins, and forbids browsers to execute responses, to
guess their types and to show them in frames.
"""

from __future__ import annotations

import os
import re
import secrets
from urllib.parse import unquote_to_bytes

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
"""Names of this machine."""
_HOST = re.compile(rf"({'|'.join(map(re.escape, LOOPBACK))})(:[0-9]{{1,5}})?", re.IGNORECASE)
"""One of them, with any port, since ports may be forwarded."""

_LONGEST_NAME = 255
"""Longest name of a file in Linux [byte]."""

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "media-src 'self'",
        "connect-src 'self'",
        "frame-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
    )
)
HEADERS = {
    "content-security-policy": POLICY,
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}


class RequestGuard:
    """Accepts requests of the page itself, below `/<token>/`, and strips that prefix."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app = app
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return
        refusal = self._refusal(scope)
        target = refusal or self._app
        if refusal is None:
            path = "/" + scope["path"].partition("/")[2].partition("/")[2]
            scope = {**scope, "path": path, "root_path": "", "raw_path": path.encode()}
        await target(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> PlainTextResponse | None:
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or not _HOST.fullmatch(hosts[0]):
            return PlainTextResponse("This page answers to localhost only.", 421)
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] != hosts[0]:
            return PlainTextResponse("Another site's request is not answered.", 403)
        if headers.get("sec-fetch-site", "none") not in {"none", "same-origin"} and (
            headers.get("sec-fetch-mode") != "navigate"
        ):
            return PlainTextResponse("Another site's request is not answered.", 403)
        if scope["method"] not in {"GET", "HEAD"} and (scope["method"] != "POST" or not origin):
            return PlainTextResponse("Only the page itself may ask for that.", 405)
        given = scope["path"].removeprefix("/").partition("/")[0]
        if not secrets.compare_digest(given.encode(), self._token.encode()):
            return PlainTextResponse(
                "Open the address that `vast` printed: it holds a secret.", 403
            )
        query = unquote_to_bytes(scope["query_string"])
        if not all(map(_may_exist, scope["path"].split("/"))) or b"\0" in query:
            return PlainTextResponse("There is no such page.", 404)
        return None


def _may_exist(name: str) -> bool:
    """Whether a part of a path can be the name of a file or of a page."""
    return name not in {".", ".."} and "\0" not in name and len(os.fsencode(name)) <= _LONGEST_NAME


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
            headers.setdefault("cache-control", "no-store")
        await send(message)

    return sending
