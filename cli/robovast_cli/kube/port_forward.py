"""Forward a port of this machine to the pods of a Service.

`kubernetes.stream.portforward` serves one connection to one pod, by a thread that ends without
closing its socket when the API server resets the connection, so that readers wait forever.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any

from robovast.base.errors import CannotRunError

LARGEST_READ = 64 * 1024
"""Block size [byte]."""

Pod = Mapping[str, Any]

_log = logging.getLogger(__name__)


class PortForward:
    """Forwards each new connection to a ready pod; connections end with their pod."""

    def __init__(
        self, server: Any, pods: Callable[[], Awaitable[Sequence[Pod]]], target: int | str
    ) -> None:
        """
        Args:
            server: the API server, as a `Configuration` of kubernetes.aio.
            pods: requests the pods.
            target: their port, by number or by name.
        """
        from kubernetes.aio.stream import WsApiClient

        self._client = WsApiClient(server)
        self._pods = pods
        self._target = target
        self._tasks: set[asyncio.Task[None]] = set()

    async def start(self) -> int:
        """Listen on a free port of the loopback interface, and return it.

        Raises:
            CannotRunError: no pod is ready.
        """
        select_pod(await self._pods(), self._target)
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    async def stop(self) -> None:
        """End all connections."""
        self._server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._client.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.create_task(self._connect(reader, writer))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            pod, port = select_pod(await self._pods(), self._target)
            async with await self._open(pod["metadata"], port) as socket:
                ways = [_send(reader, socket), _receive(socket, writer)]
                await _until_one_ends([asyncio.create_task(way) for way in ways])
        except Exception as error:  # the user of the port notices and reports it
            _log.debug("a forwarded connection has ended: %r", error)
        finally:
            writer.close()

    async def _open(self, pod: Mapping[str, str], port: int) -> Any:
        path = f"/api/v1/namespaces/{pod['namespace']}/pods/{pod['name']}/portforward"
        method, url, headers, *_ = await self._client.param_serialize(
            "GET", path, query_params={"ports": str(port)}, auth_settings=["BearerToken"]
        )
        return await self._client.request(method, url, headers=headers, _preload_content=False)


def select_pod(pods: Sequence[Pod], target: int | str) -> tuple[Pod, int]:
    """Return a ready pod and the number of its port.

    Raises:
        CannotRunError: there is none.
    """
    for pod in pods:
        port = _port(pod, target)
        if port and _is_ready(pod):
            return pod, port
    raise CannotRunError(
        "none of its pods is ready", hint="run `kubectl get pods` to see the cause"
    )


def _is_ready(pod: Pod) -> bool:
    conditions = pod.get("status", {}).get("conditions") or ()
    ready = any(c["type"] == "Ready" and c["status"] == "True" for c in conditions)
    return ready and not pod["metadata"].get("deletionTimestamp")


def _port(pod: Pod, target: int | str) -> int | None:
    if isinstance(target, int):
        return target
    ports = (port for c in pod["spec"]["containers"] for port in c.get("ports") or ())
    return next((int(port["containerPort"]) for port in ports if port.get("name") == target), None)


async def _until_one_ends(tasks: Sequence[asyncio.Task[None]]) -> None:
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _send(reader: asyncio.StreamReader, socket: Any) -> None:
    while data := await reader.read(LARGEST_READ):
        await socket.send_bytes(b"\0" + data)


async def _receive(socket: Any, writer: asyncio.StreamWriter) -> None:
    """Forward data on channel 0; channel 1 reports errors. Both begin with the port."""
    begun = set()
    while True:
        message = await socket.receive_bytes()
        channel, data = message[0], message[1:]
        if channel not in begun:
            begun.add(channel)
        elif channel == 0:
            writer.write(data)
            await writer.drain()
        else:
            raise ConnectionError(data.decode(errors="replace"))
