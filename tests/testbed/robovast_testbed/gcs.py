"""Google Cloud Storage without Google: fake-gcs-server, which needs no testbed."""

import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from . import gobuild, programs
from .bed import Daemon
from .commands import wait_for


@contextmanager
def started() -> Iterator[str]:
    """Run a server on the loopback interface; gives HOST:PORT.

    It keeps objects in memory, checks neither accounts nor permissions, and ends with its parent.

    :raises Unavailable: when the machine cannot build it.
    :raises StartFailed: when it does not answer in time.
    """
    program = gobuild.build(programs.FAKE_GCS)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [
        *("setpriv", "--pdeathsig", "KILL", program, "-backend", "memory", "-scheme", "http"),
        *("-host", "127.0.0.1", "-port", str(port), "-log-level", "warn"),
    ]
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        with log.open("wb") as stream, subprocess.Popen(command, stderr=stream) as process:
            daemon = Daemon(program.name, process, log)
            wait_for(program.name, lambda: _answers(port), failed=daemon.failure)
            try:
                yield f"127.0.0.1:{port}"
            finally:
                process.kill()


def _answers(port: int) -> bool:
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=2):
            return True
    except OSError:
        return False
