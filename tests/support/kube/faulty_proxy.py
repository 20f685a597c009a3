"""A proxy before a Kubernetes API server that breaks what goes through it, as it is told."""

from __future__ import annotations

import asyncio
import json
import re
import ssl
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

import aiohttp
import yaml
from aiohttp import web
from robovast_testbed.kubernetes import Cluster

Answer = web.StreamResponse
Forward = Callable[[], Awaitable[Answer]]
Action = Callable[[web.Request, Forward], Awaitable[Answer]]

FIRST_ONLY = web.RequestKey("first event only", bool)
HOP_BY_HOP = frozenset({"connection", "content-length", "host", "transfer-encoding"})


@dataclass
class Fault:
    """What happens to requests that it fits."""

    method: str
    path: str
    """A regular expression, searched in the path with its query."""
    action: Action
    times: int
    """How many requests it still hits."""
    hits: int = 0

    def fits(self, request: web.Request) -> bool:
        """Whether a request is hit."""
        wanted = self.times > 0 and request.method == self.method
        return wanted and re.search(self.path, request.path_qs) is not None


@dataclass
class _Watch:
    """A stream of events that is open."""

    path: str
    transport: asyncio.Transport
    silent: bool = False


@dataclass
class FaultyApi:
    """The proxy. It speaks plain HTTP, and hands on whom the client says to be."""

    server: str
    trust: ssl.SSLContext
    address: str = ""
    seen: list[tuple[float, str, str, int]] = field(default_factory=list)
    """Time, method, path and answer of each request; 0 where a connection was cut."""
    _faults: list[Fault] = field(default_factory=list)
    _watches: list[_Watch] = field(default_factory=list)
    _loop: asyncio.AbstractEventLoop = field(default_factory=asyncio.new_event_loop)

    def break_(self, method: str, path: str, action: Action, times: int = 1_000_000) -> Fault:
        """Let a fault hit the next requests that fit."""
        fault = Fault(method, path, action, times)
        self._faults.append(fault)
        return fault

    def mend(self) -> None:
        """Hand on everything from now on."""
        self._faults.clear()

    def cut_watches(self, path: str = "") -> int:
        """Cut the streams that are open; returns how many."""
        return self._in_loop(self._cut, path)

    def silence_watches(self, path: str = "") -> int:
        """Let the streams that are open stay so, without another byte; returns how many."""
        return self._in_loop(self._silence, path)

    def open_watches(self, path: str = "") -> list[str]:
        """Paths of the streams that are open."""
        return [watch.path for watch in self._open(path)]

    def _in_loop(self, act: Callable[[str], int], path: str) -> int:
        done: Future[int] = Future()
        self._loop.call_soon_threadsafe(lambda: done.set_result(act(path)))
        return done.result(timeout=60)

    def _open(self, path: str) -> list[_Watch]:
        return [watch for watch in self._watches if re.search(path, watch.path)]

    def _cut(self, path: str) -> int:
        found = self._open(path)
        for watch in found:
            watch.transport.abort()
        return len(found)

    def _silence(self, path: str) -> int:
        found = self._open(path)
        for watch in found:
            watch.silent = True
        return len(found)

    async def _serve(self, started: Callable[[str], None], ended: asyncio.Event) -> None:
        connector = aiohttp.TCPConnector(ssl=self.trust, limit=0)
        endless = aiohttp.ClientTimeout(total=None)
        async with aiohttp.ClientSession(
            connector=connector, timeout=endless, auto_decompress=False
        ) as session:

            async def handle(request: web.Request) -> Answer:
                return await self._handle(session, request)

            server = web.Server(handle, access_log=None, handler_cancellation=True)
            runner = web.ServerRunner(server, handle_signals=False, shutdown_timeout=0)
            await runner.setup()
            await web.TCPSite(runner, "127.0.0.1", 0).start()
            host, port = runner.addresses[0][:2]
            started(f"http://{host}:{port}")
            await ended.wait()
            self._cut("")
            await runner.cleanup()

    async def _handle(self, session: aiohttp.ClientSession, request: web.Request) -> Answer:
        body = await request.read()

        async def forward() -> Answer:
            return await self._forward(session, request, body)

        fault = next((fault for fault in self._faults if fault.fits(request)), None)
        if fault is not None:
            fault.times -= 1
            fault.hits += 1
        code = 0
        try:
            answer = await (forward() if fault is None else fault.action(request, forward))
            code = answer.status if request.transport is not None else 0
        finally:
            self.seen.append((time.monotonic(), request.method, request.path, code))
        return answer

    async def _forward(
        self, session: aiohttp.ClientSession, request: web.Request, body: bytes
    ) -> Answer:
        headers = {k: v for k, v in request.headers.items() if k.lower() not in HOP_BY_HOP}
        url = self.server + request.path_qs
        try:
            async with session.request(
                request.method, url, headers=headers, data=body or None
            ) as answer:
                kept = {k: v for k, v in answer.headers.items() if k.lower() not in HOP_BY_HOP}
                if "watch=true" not in request.query_string:
                    data = await answer.read()
                    return web.Response(status=answer.status, headers=kept, body=data)
                return await self._stream(request, answer, kept)
        except aiohttp.ClientError:  # the server is away
            abort(request)
            return web.Response(status=502)

    async def _stream(
        self, request: web.Request, answer: aiohttp.ClientResponse, headers: dict[str, str]
    ) -> Answer:
        told = web.StreamResponse(status=answer.status, headers=headers)
        await told.prepare(request)
        assert request.transport is not None
        watch = _Watch(request.path_qs, request.transport)
        self._watches.append(watch)
        try:
            async for data in answer.content.iter_any():
                if request.get(FIRST_ONLY) and b"\n" in data:
                    await told.write(data[: data.index(b"\n") + 1])
                    watch.transport.close()
                    break
                if not watch.silent:
                    await told.write(data)
            while watch.silent:
                await asyncio.sleep(0.1)
        finally:
            self._watches.remove(watch)
        return told


def abort(request: web.Request) -> None:
    """Cut the connection of a request."""
    if request.transport is not None:
        request.transport.abort()


def refuse(code: int, retry_after: int | None = None) -> Action:
    """The server is busy, or broken, and does nothing."""

    async def act(request: web.Request, forward: Forward) -> Answer:
        del request, forward
        headers = {} if retry_after is None else {"Retry-After": str(retry_after)}
        told = {"kind": "Status", "apiVersion": "v1", "status": "Failure", "code": code}
        return web.json_response(told, status=code, headers=headers)

    return act


async def cut_answer(request: web.Request, forward: Forward) -> Answer:
    """The server has done it, but nobody hears of it."""
    answer = await forward()
    abort(request)
    return answer


async def cut_in_the_middle(request: web.Request, forward: Forward) -> Answer:
    """Half of the answer comes."""
    answer = await forward()
    assert isinstance(answer, web.Response)
    assert isinstance(answer.body, bytes)
    told = web.StreamResponse(status=answer.status, headers={"Content-Type": "application/json"})
    told.content_length = len(answer.body)
    await told.prepare(request)
    await told.write(answer.body[: len(answer.body) // 2])
    abort(request)
    return told


async def cut_first_event(request: web.Request, forward: Forward) -> Answer:
    """A stream that is cut after its first event."""
    request[FIRST_ONLY] = True
    return await forward()


def fail_after(code: int) -> Action:
    """The server has done it, but says that it has not."""

    async def act(request: web.Request, forward: Forward) -> Answer:
        await forward()
        return await refuse(code)(request, forward)

    return act


def delay(seconds: float) -> Action:
    """The server takes its time."""

    async def act(request: web.Request, forward: Forward) -> Answer:
        del request
        await asyncio.sleep(seconds)
        return await forward()

    return act


def hold(until: threading.Event, then: Action) -> Action:
    """The server answers no sooner than that."""

    async def act(request: web.Request, forward: Forward) -> Answer:
        while not until.is_set():
            await asyncio.sleep(0.05)
        return await then(request, forward)

    return act


def watch_error(code: int, reason: str) -> Action:
    """A stream that brings nothing but an error: 410 says that history was thrown away."""

    async def act(request: web.Request, forward: Forward) -> Answer:
        del request, forward
        told: dict[str, Any] = {
            "kind": "Status", "apiVersion": "v1", "status": "Failure",
            "code": code, "reason": reason, "message": "a fault that was asked for",
        }  # fmt: skip
        text = json.dumps({"type": "ERROR", "object": told}) + "\n"
        return web.Response(text=text, content_type="application/json")

    return act


@contextmanager
def faulty_api(cluster: Cluster) -> Iterator[FaultyApi]:
    """A proxy before the API server of a cluster."""
    config = yaml.safe_load(cluster.kubeconfig.read_text())["clusters"][0]["cluster"]
    trust = ssl.create_default_context(cafile=config["certificate-authority"])
    proxy = FaultyApi(config["server"], trust)
    ready: Future[str] = Future()
    ended = asyncio.Event()

    def run() -> None:
        asyncio.set_event_loop(proxy._loop)
        proxy._loop.run_until_complete(proxy._serve(ready.set_result, ended))
        proxy._loop.close()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    proxy.address = ready.result(timeout=60)
    try:
        yield proxy
    finally:
        with suppress(RuntimeError):
            proxy._loop.call_soon_threadsafe(ended.set)
        thread.join(timeout=60)
