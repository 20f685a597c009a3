"""A way to a server that breaks: connections through it are cut after a number of bytes."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


class CuttingProxy:
    """Hands bytes on between clients and a server; may cut connections."""

    def __init__(self, server: str) -> None:
        host, _, port = server.rpartition(":")
        self._server = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self.received = 0
        """Bytes that came from the server so far."""
        self.cuts = 0
        """How many connections were cut so far."""
        self._lock = threading.Lock()
        self._limits: dict[str, int] = {}

    def cut_once(
        self,
        *,
        sent: int | None = None,
        received: int | None = None,
        first: Callable[[], object] = lambda: None,
    ) -> None:
        """Cut the next connection that carries so many bytes, from or to the client.

        What shall happen right before that is `first`.
        """
        self._first = first
        limits = {"sent": sent, "received": received}
        self._limits = {way: limit for way, limit in limits.items() if limit is not None}

    def serve(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            server = socket.create_connection(self._server)
            for way, source, target in (("sent", client, server), ("received", server, client)):
                threading.Thread(
                    target=self._hand_on, args=(way, source, target), daemon=True
                ).start()

    def close(self) -> None:
        # Closing alone does not wake who waits in accept().
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _hand_on(self, way: str, source: socket.socket, target: socket.socket) -> None:
        carried = 0
        with source, target, suppress(OSError):
            while data := source.recv(65536):
                carried += len(data)
                if way == "received":
                    with self._lock:
                        self.received += len(data)
                if carried > self._limits.get(way, carried):
                    del self._limits[way]
                    self.cuts += 1
                    self._first()
                    for end in (source, target):
                        end.shutdown(socket.SHUT_RDWR)
                    return
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)


@contextmanager
def cutting_proxy(server: str) -> Iterator[CuttingProxy]:
    """A proxy to HOST:PORT."""
    proxy = CuttingProxy(server)
    thread = threading.Thread(target=proxy.serve, daemon=True)
    thread.start()
    try:
        yield proxy
    finally:
        proxy.close()
        thread.join()
