"""Parts of a running cluster that stop for a while: `etcd`, `kube-apiserver`, `containerd`, …"""

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from . import leftovers
from .bed import Bed
from .commands import wait_for
from .errors import StartFailed
from .kubernetes import Cluster


@dataclass(frozen=True)
class Process:
    """A process of a testbed, in a container or not."""

    pid: int
    command: tuple[str, ...]

    @property
    def files(self) -> Path:
        """Return the root of the files that it sees."""
        return Path(f"/proc/{self.pid}/root")

    @property
    def environment(self) -> dict[str, str]:
        """Return the variables that it was started with."""
        pairs = Path(f"/proc/{self.pid}/environ").read_bytes().decode().split("\0")
        return dict(pair.split("=", 1) for pair in pairs if "=" in pair)

    def signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, number)


def processes(bed: Bed, wanted: Callable[[Sequence[str]], bool]) -> Iterator[Process]:
    """Return the processes of a testbed whose command is as wanted."""
    for pid in leftovers.belonging(bed.netns, bed.folder):
        with suppress(OSError):  # it may end at any moment
            command = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace")
            process = Process(pid, tuple(command.split("\0")[:-1]))
            if wanted(process.command):
                yield process


@contextmanager
def paused(cluster: Cluster, part: str) -> Iterator[None]:
    """Let a part hang for as long as the block runs."""
    process = _find(cluster, part)
    process.signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.signal(signal.SIGCONT)


def restart(cluster: Cluster, part: str, seconds: float) -> None:
    """Kill a part, start it again after a time, and wait until the API server answers.

    :raises StartFailed: when it does not answer in time.
    """
    process = _find(cluster, part)
    environment = process.environment
    process.signal(signal.SIGKILL)
    time.sleep(seconds)
    # Forked, so that it may outlive this process where the cluster is kept.
    command = ["setsid", "--fork", *process.command]
    cluster.bed.spawn(part, command, env=environment).process.wait()
    wait_for(part, lambda: _answers(cluster), failed=lambda: None)


def _find(cluster: Cluster, part: str) -> Process:
    """Find the process of a part; also of a cluster that another process has started."""

    def is_part(command: Sequence[str]) -> bool:
        return command[1:2] == (part,) or (bool(command) and Path(command[0]).name == part)

    for process in processes(cluster.bed, is_part):
        return process
    raise StartFailed(f"{part} does not run in the testbed {cluster.bed.name}")


def _answers(cluster: Cluster) -> bool:
    try:
        return cluster.kubectl("get", "--raw=/readyz") == "ok"
    except StartFailed:
        return False
