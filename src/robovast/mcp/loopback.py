"""Listening sockets restricted to this machine."""

from __future__ import annotations

import socket

from robovast.base.errors import InputError

_FAMILIES = {"127.0.0.1": socket.AF_INET, "localhost": socket.AF_INET, "::1": socket.AF_INET6}


def listen(host: str, port: int) -> socket.socket:
    """Create a listening socket.

    Args:
        host: the loopback interface, by name or address.
        port: 0 for any free port.

    Raises:
        InputError: the host is not this machine's loopback interface, or the port is taken.
    """
    if host not in _FAMILIES:
        raise InputError(
            f"The server answers on this machine only (127.0.0.1 or ::1), not on {host}",
            hint=f"from another machine, forward the port: ssh -L {port}:localhost:{port} <this "
            "machine>",
        )
    listener = socket.socket(_FAMILIES[host], socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise InputError(
            f"Port {port} of {host} cannot be used: {error.strerror}",
            hint="name another with `--port`",
        ) from None
    return listener
