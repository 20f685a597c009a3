"""Requests to the Kubernetes API: few, patient with a busy server, clear when refused."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any

import aiohttp
from kubernetes import config
from kubernetes.aio.client import ApiClient, Configuration

from robovast.base.errors import CannotRunError
from robovast_operator.kube.objects import Object
from robovast_operator.kube.times import hear
from robovast_operator.kube.untrusted_fields import shaped

LOGGER = logging.getLogger(__name__)

FIELD_MANAGER = "robovast-operator"

MERGE_PATCH = "application/merge-patch+json"
APPLY_PATCH = "application/apply-patch+yaml"

TRIES = 5
PAUSE = 2.0
"""Pause between attempts that are repeated without end [s]."""
PAGE = 100
"""Objects in one page of a list: a page is held in memory whole."""


class ApiError(Exception):
    """The server refused a request."""

    def __init__(self, code: int, reason: str, message: str) -> None:
        super().__init__(f"{message} ({code} {reason})")
        self.code = code
        self.reason = reason
        self.terminating = code == 403 and "being terminated" in message
        """Whether the namespace is being deleted."""
        self.over_quota = code == 403 and "exceeded quota" in message


class Api:
    """A client of one API server."""

    def __init__(
        self,
        client: ApiClient,
        metrics: Any = None,
        may_write: Callable[[], bool] = lambda: True,
    ) -> None:
        """Make a client.

        Args:
            client: knows where the server is, and who we are.
            metrics: count requests, if given.
            may_write: asked before each request that changes anything, so that a replica that
                slept while another took over does nothing more.
        """
        self._client = client
        self._metrics = metrics
        self._may_write = may_write

    async def close(self) -> None:
        """End all connections."""
        await self._client.close()

    async def get(self, path: str, *, tries: int = TRIES) -> Object:
        """Read an object; a busy or unreachable server is asked `tries` times."""
        return await self._request("GET", path, tries=tries)

    async def list(self, path: str, **parameters: str) -> AsyncIterator[Object]:
        """Read the objects of a collection page by page; each dropped object frees its memory.

        Args:
            path: of the collection.
            parameters: of the query, `labelSelector` and the like.
        """
        query = {"limit": str(PAGE), **parameters}
        while True:
            page = await self._request("GET", path, query=query)
            token, items = page.get("metadata", {}).get("continue"), page.get("items") or []
            items.reverse()
            while items:
                yield shaped(items.pop())
            if not token:
                return
            if token == query.get("continue"):
                raise OSError(f"GET {path}: the server sends the same page of the list again")
            query = {**query, "continue": token}

    async def can_stream_lists(self, path: str) -> bool:
        """Return whether a watch may begin with a list; Kubernetes 1.33 refuses that by default.

        Waits for a server that is busy or away.

        Args:
            path: of a collection.
        """
        while True:
            try:
                async with self._send("GET", path, query=_STREAMED_LIST) as response:
                    if response.status < 500 and response.status != 429:
                        return response.status < 400
                    problem = f"the server answers {response.status}"
            except (aiohttp.ClientError, TimeoutError) as error:
                problem = str(error) or type(error).__name__
            LOGGER.warning("GET %s: %s; again in %.0f s", path, problem, PAUSE)
            await asyncio.sleep(PAUSE)

    async def create(self, path: str, obj: Object, *, dry_run: bool = False) -> Object | None:
        """Create an object; return None if an object of the same name exists.

        Args:
            path: of the collection.
            obj: the object.
            dry_run: only check whether the server would accept the object.
        """
        query = {**_MANAGED, "dryRun": "All"} if dry_run else _MANAGED
        try:
            return await self._request("POST", path, body=obj, query=query)
        except ApiError as error:
            if error.code == 409 and error.reason == "AlreadyExists":
                return None
            # The server checks quotas before names.
            if error.over_quota and await self._exists(path, obj["metadata"].get("name")):
                return None
            raise

    async def _exists(self, path: str, name: str | None) -> bool:
        """Return whether a collection has an object of a name; needs only `list`."""
        if not name:
            return False
        async for _ in self.list(path, fieldSelector=f"metadata.name={name}"):
            return True
        return False

    async def patch(self, path: str, patch: Object) -> Object | None:
        """Change fields of an object; return None if the object does not exist."""
        return await self._gone_is_none("PATCH", path, body=patch, kind=MERGE_PATCH)

    async def apply_status(self, path: str, obj: Object) -> Object | None:
        """Write the whole status of an object; return None if the object does not exist."""
        query = {"force": "true", **_MANAGED}
        return await self._gone_is_none(
            "PATCH", f"{path}/status", body=obj, kind=APPLY_PATCH, query=query
        )

    async def delete(self, path: str, *, after_children: bool = True) -> None:
        """Delete an object and its dependents; a missing object counts as deleted.

        Args:
            path: of the object.
            after_children: the object stays until what it owns is gone, a Job until its pods are.
        """
        how = "Foreground" if after_children else "Background"
        await self._gone_is_none("DELETE", path, query={"propagationPolicy": how})

    async def update(self, path: str, obj: Object) -> Object:
        """Replace an object, unless the object has changed since the read."""
        return await self._request("PUT", path, body=obj)

    async def _gone_is_none(self, method: str, path: str, **arguments: Any) -> Object | None:
        try:
            return await self._request(method, path, **arguments)
        except ApiError as error:
            if error.code == 404:
                return None
            raise

    async def _request(
        self,
        method: str,
        path: str,
        *,
        body: Object | None = None,
        kind: str = "application/json",
        query: Mapping[str, str] | None = None,
        tries: int = TRIES,
    ) -> Object:
        for attempt in range(tries):
            try:
                answer, retry = await self._once(method, path, body, kind, query or {})
            except (aiohttp.ClientError, TimeoutError) as error:
                if attempt == tries - 1:
                    raise ApiError(0, "Unreachable", f"{method} {path}: {error}") from error
                retry = 2.0**attempt / 4
            else:
                if retry is None:
                    return answer
            await asyncio.sleep(retry)
        raise ApiError(429, "TooManyRequests", f"{method} {path}: the server stays busy")

    async def _once(
        self,
        method: str,
        path: str,
        body: Object | None,
        kind: str,
        query: Mapping[str, str],
    ) -> tuple[Object, float | None]:
        """Send a request once: return the answer, or how long the server asks to wait."""
        if method != "GET" and not self._may_write():
            raise ApiError(0, "NotLeading", f"{method} {path}: another replica may be the leader")
        async with self._send(method, path, body, kind, query) as response:
            if response.status in {429, 503}:
                return {}, _seconds(response.headers.get("Retry-After", ""))
            text = await response.text()
            if response.status >= 400:
                raise _refusal(response.status, text, f"{method} {path}")
            return json.loads(text), None

    @asynccontextmanager
    async def _send(
        self,
        method: str,
        path: str,
        body: Object | None = None,
        kind: str = "application/json",
        query: Mapping[str, str] | None = None,
    ) -> AsyncIterator[aiohttp.ClientResponse]:
        _, url, headers, *_ = await self._client.param_serialize(
            method,
            path,
            query_params=dict(query or {}),
            header_params={"Content-Type": kind, "Accept": "application/json"},
            auth_settings=["BearerToken"],
        )
        answer = await self._client.call_api(method, url, headers, body, _request_timeout=_TIMEOUT)
        async with answer.response as response:
            if self._metrics is not None:
                self._metrics.request(method, path, response.status)
            hear(response.headers.get("Date", ""))
            yield response


def _seconds(retry_after: str) -> float:
    """Return how long the server asks to wait; a date, which proxies may send, is ignored."""
    return float(retry_after) if retry_after.isdecimal() else 1.0


def _refusal(code: int, text: str, request: str) -> ApiError:
    """Return why the server rejected a request; the answer may be plain text."""
    try:
        data = json.loads(text)
        return ApiError(code, data.get("reason", ""), data.get("message") or request)
    except (ValueError, AttributeError):
        return ApiError(code, "", f"{request}: {text.strip()[:200]}")


_MANAGED = {"fieldManager": FIELD_MANAGER}

_STREAMED_LIST = {
    "watch": "true",
    "sendInitialEvents": "true",
    "resourceVersionMatch": "NotOlderThan",
    "allowWatchBookmarks": "true",
    "fieldSelector": "metadata.name=-",  # nothing has that name: the answer is all that counts
}
_TIMEOUT = aiohttp.ClientTimeout(total=30, connect=10)


def connect() -> ApiClient:
    """Return a client of the API server, with separate connections."""
    return ApiClient(server())


def server() -> Configuration:
    """Return how to reach the API server: from a pod by its environment, else by kubeconfig.

    The address needs no DNS, which may be away; a pod's token is read again as it is renewed.

    Raises:
        CannotRunError: there is neither.
    """
    made = Configuration()
    made.connection_pool_maxsize = 20
    made.client_session_kwargs = {"trust_env": False, "read_bufsize": 2**16}
    try:
        config.load_incluster_config(client_configuration=made)
    except config.ConfigException:
        try:
            config.load_kube_config(client_configuration=made)
        except config.ConfigException as error:
            raise CannotRunError(
                "There is no way to the Kubernetes API: neither a service account nor a "
                f"kubeconfig: {error}"
            ) from error
    return made
