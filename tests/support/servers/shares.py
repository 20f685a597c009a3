"""Servers for shares on the loopback interface."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

USER, PASSWORD = "tester", "pass word-92f"


@contextmanager
def webdav_server(
    root: Path,
    user: str = USER,
    password: str = PASSWORD,
    *,
    address: tuple[str, int] = ("127.0.0.1", 0),
) -> Iterator[str]:
    """WsgiDAV behind Cheroot; gives its address."""
    from cheroot import wsgi
    from wsgidav.wsgidav_app import WsgiDAVApp

    app = WsgiDAVApp(
        {
            "provider_mapping": {"/": str(root)},
            "simple_dc": {"user_mapping": {"*": {user: {"password": password}}}},
            "http_authenticator": {"accept_digest": False, "default_to_digest": False},
            "logging": {"enable": False},
            "verbose": 0,
            "dir_browser": {"enable": False},
        }
    )
    server = wsgi.Server(address, app)
    server.prepare()
    thread = threading.Thread(target=server.serve, daemon=True)
    thread.start()
    try:
        yield f"{address[0]}:{server.bind_addr[1]}"
    finally:
        server.stop()
        thread.join()


@contextmanager
def webdav_process(root: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The same in a process of its own; gives that, and its address."""
    command = [sys.executable, __file__, root, "127.0.0.1", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    with process:
        try:
            assert process.stdout is not None
            yield process, process.stdout.readline().split()[-1]
        finally:
            process.kill()


@dataclass
class SftpServer:
    """An SSH server that only does SFTP."""

    port: int
    host_key: str
    """As in `known_hosts`, without the name."""
    client_key: str
    """Private key that it accepts, PEM."""


@contextmanager
def sftp_server(root: Path, address: tuple[str, int] = ("127.0.0.1", 0)) -> Iterator[SftpServer]:
    """asyncssh, confined to a folder."""
    import asyncssh

    host_key = asyncssh.generate_private_key("ssh-ed25519")
    client_key = asyncssh.generate_private_key("ssh-ed25519")

    connections: list[Any] = []

    class Account(asyncssh.SSHServer):
        def connection_made(self, conn: Any) -> None:
            connections.append(conn)

        def password_auth_supported(self) -> bool:
            return True

        def validate_password(self, username: str, password: str) -> bool:
            return (username, password) == (USER, PASSWORD)

        def validate_public_key(self, username: str, key: Any) -> bool:
            return username == USER and key == client_key.convert_to_public()

        def public_key_auth_supported(self) -> bool:
            return True

    def files(channel: Any) -> Any:
        return asyncssh.SFTPServer(channel, chroot=str(root))

    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()

    async def listen() -> Any:
        return await asyncssh.create_server(
            Account, *address, server_host_keys=[host_key], sftp_factory=files
        )

    server = asyncio.run_coroutine_threadsafe(listen(), loop).result(30)
    public = host_key.export_public_key().decode().strip()
    pem = client_key.export_private_key("openssh").decode()
    try:
        yield SftpServer(server.get_port(), public, pem)
    finally:
        asyncio.run_coroutine_threadsafe(_closed(server, connections), loop).result(30)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _closed(server: Any, connections: list[Any]) -> None:
    server.close()
    for connection in connections:
        connection.abort()
    await asyncio.gather(*(item.wait_closed() for item in connections))
    await server.wait_closed()


def serve(root: Path, host: str, port: int, sftp_port: int | None = None) -> None:
    """A WebDAV server, and one for SFTP when it has a port, until they are killed."""
    with ExitStack() as stack:
        if sftp_port is not None:
            server = stack.enter_context(sftp_server(root, (host, sftp_port)))
            print("host key", server.host_key, flush=True)
        print("serving", stack.enter_context(webdav_server(root, address=(host, port))), flush=True)
        threading.Event().wait()


if __name__ == "__main__":  # FOLDER HOST PORT [SFTP PORT]
    serve(Path(sys.argv[1]), sys.argv[2], *map(int, sys.argv[3:]))
