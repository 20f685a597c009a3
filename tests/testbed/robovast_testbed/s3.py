"""Object stores that speak S3: two of different make, so that no test relies on one's habits."""

import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from . import gobuild, network, programs
from .bed import Bed, Daemon
from .commands import wait_for

ACCESS_KEY = "testbed"
SECRET_KEY = "testbed-secret"


@dataclass(frozen=True)
class _Make:
    """How to run one make of server."""

    program: gobuild.Program
    port: int
    arguments: Callable[[int, Path], Sequence[str | Path]]
    env: Mapping[str, str]


MAKES = {
    "minio": _Make(
        programs.MINIO,
        9000,
        lambda port, folder: (
            *("server", "--quiet", "--address", f":{port}"),
            *("--certs-dir", folder / "certs", folder / "data"),
        ),
        {"MINIO_ROOT_USER": ACCESS_KEY, "MINIO_ROOT_PASSWORD": SECRET_KEY, "MINIO_BROWSER": "off"},
    ),
    "versitygw": _Make(
        programs.VERSITYGW,
        7070,
        lambda port, folder: (
            *("--port", f"0.0.0.0:{port}", "--quiet"),
            *("posix", "--sidecar", folder / "meta", folder / "data"),
        ),
        {"ROOT_ACCESS_KEY": ACCESS_KEY, "ROOT_SECRET_KEY": SECRET_KEY},
    ),
}


@dataclass
class Server:
    """A running object store with an empty account."""

    make: str
    bed: Bed
    endpoint: str
    """HOST:PORT for programs outside the namespace."""
    access_key: str = ACCESS_KEY
    secret_key: str = SECRET_KEY
    _daemon: Daemon | None = None

    @property
    def inner_endpoint(self) -> str:
        """Return HOST:PORT for pods and other programs inside the namespace."""
        return f"{network.NODE_IP}:{MAKES[self.make].port}"

    def stop(self) -> None:
        """Kill the server; what it has stored stays."""
        if self._daemon is not None:
            self._daemon.process.kill()
            self._daemon.process.wait()
            self._daemon = None

    def start(self) -> None:
        """Start the server again, at the same endpoint, and wait until it answers."""
        make = MAKES[self.make]
        folder = self.bed.folder / self.make
        for name in ("certs", "data", "meta"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        command = [gobuild.build(make.program), *make.arguments(make.port, folder)]
        self._daemon = self.bed.spawn(self.make, command, env=make.env)
        wait_for(self.make, self._answers, failed=self._daemon.failure)

    def _answers(self) -> bool:
        try:
            with urllib.request.urlopen(f"http://{self.endpoint}/", timeout=2):
                return True
        except urllib.error.HTTPError as refusal:  # a request without a signature
            refusal.close()
            return refusal.code < 500
        except OSError:
            return False


def start(bed: Bed, make: str) -> Server:
    """Start an object store of this make (a key of MAKES) in a testbed that has its bridge.

    :raises Unavailable: when the machine cannot build it.
    :raises StartFailed: when it does not answer in time.
    """
    port = network.publish(bed, MAKES[make].port)
    server = Server(make, bed, f"127.0.0.1:{port}")
    server.start()
    return server
