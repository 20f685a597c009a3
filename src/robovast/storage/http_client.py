"""HTTP servers as RoboVAST uses them: patient, explained, and silent on credentials.

It adds to `urllib3` what its `Retry` does not offer: patience in seconds instead of attempts,
requests that must not be repeated, bodies made anew, and errors that name the remedy.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import IO, Any, Required, TypedDict, Unpack
from urllib.parse import urlsplit

import certifi
import urllib3
from urllib3.exceptions import HTTPError, NewConnectionError, SSLError

from robovast.base.backoff import BUSY, FIRST_CONTACT, TRANSFERRING, Pauses
from robovast.base.errors import StorageError
from robovast.base.sizes import whole_number

Body = bytes | IO[bytes] | None

ATTEMPTS = 3
"""How often a long upload is restarted."""
SILENCE = 120.0
"""Timeout of a request [s]."""
CHUNK = 2**20
"""Part of a response that is read into memory [byte]."""

_NOT_TAKEN = frozenset({429, 503})
"""Statuses of requests that were not processed."""
_LONGEST_QUOTE = 300
_SHORTEST_SECRET = 4
"""Shorter secrets are not masked, since they occur in any text."""


class HttpError(StorageError):
    """A server refused a request."""

    def __init__(self, message: str, status: int = 0, *, hint: str = "") -> None:
        super().__init__(message, hint=hint)
        self.status = status


class RequestOptions(TypedDict, total=False):
    """What a request has beside its method and address."""

    attempt: Required[str]
    """What is tried, for messages: `make a draft`."""
    body: Callable[[], Body]
    """Makes the body of each attempt anew."""
    headers: Mapping[str, str]
    """Beside those of every request."""
    accept: Collection[int]
    """Statuses that are no error, beside 200 to 299."""
    repeatable: bool
    """Doing it twice is as good as once, which is assumed when omitted."""


class HttpClient:
    """Sends requests to one server; temporary errors are retried.

    Redirections are never followed, so that credentials do not reach other servers.
    """

    def __init__(
        self,
        name: str,
        headers: Mapping[str, str],
        *,
        remedies: Mapping[int, str] | None = None,
        secrets: Collection[str] = (),
        insecure: bool = False,
        patience: float = TRANSFERRING,
        timeout: float = SILENCE,
    ) -> None:
        """
        Args:
            name: the server's name in messages.
            headers: headers of every request.
            remedies: remedies by HTTP status.
            secrets: texts that no message may contain.
            insecure: accept any certificate.
            patience: how long to retry [s].
            timeout: timeout of a request [s].
        """
        self.name = name
        self._headers = dict(headers)
        self._remedies = remedies or {}
        known = {secret for secret in secrets if len(secret) >= _SHORTEST_SECRET}
        self._secrets = sorted(known, key=len, reverse=True)  # one may contain another
        self._patience = patience
        self._has_answered = False
        if insecure:
            urllib3.disable_warnings(urllib3.exceptions.InsecureRequestWarning)
        self._pool = urllib3.PoolManager(
            cert_reqs="CERT_NONE" if insecure else "CERT_REQUIRED",
            ca_certs=None if insecure else os.environ.get("SSL_CERT_FILE") or certifi.where(),
            timeout=urllib3.Timeout(connect=10, read=timeout),
            retries=False,
        )

    def request(
        self, method: str, url: str, **options: Unpack[RequestOptions]
    ) -> urllib3.BaseHTTPResponse:
        """The answer to a request, read; see `opened`."""
        with self.opened(method, url, preload=True, **options) as answer:
            return answer

    @contextmanager
    def opened(
        self, method: str, url: str, *, preload: bool = False, **options: Unpack[RequestOptions]
    ) -> Iterator[urllib3.BaseHTTPResponse]:
        """The answer to a request, to be read while the context lasts.

        Args:
            method: of HTTP.
            url: absolute.
            preload: read it at once.
            options: of the request.

        Raises:
            HttpError: the server refused.
            StorageError: it cannot be reached.
        """
        attempt, repeatable = options["attempt"], options.get("repeatable", True)
        body = options.get("body", lambda: None)
        pauses = self._pauses()
        while True:
            try:
                answer = self._pool.request(
                    method,
                    url,
                    body=body(),
                    headers={**self._headers, **options.get("headers", {})},
                    redirect=False,
                    preload_content=preload,
                )
            except HTTPError as error:
                fatal = isinstance(error, SSLError) or not (
                    repeatable or isinstance(error, NewConnectionError)
                )
                if fatal or not pauses.wait():
                    raise self._unreachable(attempt, url, error) from None
                continue
            self._has_answered = True
            if 200 <= answer.status < 300 or answer.status in options.get("accept", ()):
                break
            again = answer.status in (BUSY if repeatable else _NOT_TAKEN)
            if not again or not pauses.wait(_retry_after(answer)):
                raise self._refused(attempt, answer)
            answer.drain_conn()
        try:
            yield answer
        finally:
            answer.close()
            answer.release_conn()

    def data(self, answer: urllib3.BaseHTTPResponse) -> dict[str, Any]:
        """The JSON object in an answer.

        Raises:
            StorageError: it is something else.
        """
        try:
            data = json.loads(answer.data)
        except ValueError:
            data = None
        if not isinstance(data, dict):
            raise StorageError(
                f"{self.name}: the answer is not a JSON object, so this is another kind of server",
                hint="check the address",
            )
        return data

    def _pauses(self) -> Pauses:
        if self._has_answered:
            return Pauses(self._patience, ATTEMPTS)
        return Pauses(min(self._patience, FIRST_CONTACT))

    def _refused(self, attempt: str, answer: urllib3.BaseHTTPResponse) -> HttpError:
        try:
            content = answer.data
        except HTTPError:
            content = b""
        # Before it is cut: a part of a secret at the end would not be found.
        content = self._clean(content.decode(errors="replace")).encode()
        start = f"{self.name}: cannot {attempt}"
        error = refused(start, answer.status, answer.headers, content, self._remedies)
        return HttpError(self._clean(error.message), error.status, hint=self._clean(error.hint))

    def _unreachable(self, attempt: str, url: str, error: HTTPError) -> StorageError:
        reason = getattr(error, "reason", None) or error
        found = unreachable(f"{self.name}: cannot {attempt}", url, reason)
        return StorageError(self._clean(found.message), hint=self._clean(found.hint))

    def _clean(self, message: str) -> str:
        for secret in self._secrets:
            message = message.replace(secret, "…")
        return message


def refused(
    start: str, status: int, headers: Mapping[str, str], content: bytes, remedies: Mapping[int, str]
) -> HttpError:
    """Return the error about a request that a server refused.

    Args:
        start: the beginning of the message: the server and the attempt.
        status: the HTTP status.
        headers: headers of the response.
        content: body of the response.
        remedies: remedies by status, which precede those for all servers.
    """
    said, location, wait = _quoted(content), headers.get("Location"), headers.get("Retry-After")
    if 300 <= status < 400 and location:
        said = f"it has moved to {urlsplit(location)._replace(query='').geturl()}"
    known = {**_REMEDIES, **remedies}
    remedy = known.get(status) or known.get(status // 100 * 100, "")
    if status == 429 and wait:
        remedy = f"wait for {wait} s, as the server asks"
    cause = f"{status}" + (f", {said}" if said else "")
    return HttpError(f"{start} ({cause})", status, hint=remedy)


def unreachable(start: str, url: str, reason: object) -> StorageError:
    """Return the error about a server that gives no valid HTTP response.

    Args:
        start: the beginning of the message: the server and the attempt.
        url: address of the request.
        reason: the cause.
    """
    place = urlsplit(url)
    return StorageError(
        f"{start}: {place.scheme}://{place.netloc} does not answer as it should "
        f"({str(reason).rpartition(': ')[2]})",
        hint="check the address and the network",
    )


def _quoted(content: bytes) -> str:
    """Return the message in the body of a response; empty for a page of HTML or XML."""
    text = content.decode("utf-8", "replace").strip()
    if text.startswith("{"):
        text = _message(text)
    return "" if text.startswith("<") else " ".join(text.split())[:_LONGEST_QUOTE]


def _message(text: str) -> str:
    """The message in a JSON response, in the formats of several servers."""
    try:
        data = json.loads(text)
    except ValueError:
        return text
    inner: Any = data.get("error")
    message = data.get("message") or (inner.get("message") if isinstance(inner, dict) else inner)
    details = data.get("errors")
    if isinstance(details, list):
        texts = [
            f"{item.get('field', '')}: {item.get('message', item.get('messages', ''))}"
            for item in details
            if isinstance(item, dict)
        ]
        return "; ".join([str(message or ""), *texts]).strip("; ")
    return str(message or text)


def _retry_after(answer: urllib3.BaseHTTPResponse) -> float:
    return float(whole_number(answer.headers.get("Retry-After")))


_REMEDIES = {
    300: "use the address that it names",
    401: "check the credentials, which the server does not accept",
    403: "use an account that is allowed to do that",
    404: "check the address",
    413: "send less: the request is larger than the server accepts",
    429: "try again later: the server gets too many requests",
    500: "try again later: the server has an internal error",
    507: "free space on the server; stored data is kept",
}
