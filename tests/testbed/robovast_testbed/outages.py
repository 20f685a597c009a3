"""Parts of a running cluster that stop for a while: `etcd`, `kube-apiserver`, …"""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from . import leftovers
from .commands import wait_for
from .errors import StartFailed
from .kubernetes import Cluster


@contextmanager
def paused(cluster: Cluster, part: str) -> Iterator[None]:
    """Let a part hang for as long as the block runs."""
    process, _ = _find(cluster, part)
    os.kill(process, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(process, signal.SIGCONT)


def restart(cluster: Cluster, part: str, seconds: float) -> None:
    """Kill a part, start it again after a time, and wait until the API server answers.

    :raises StartFailed: when it does not answer within 60 s.
    """
    process, command = _find(cluster, part)
    os.kill(process, signal.SIGKILL)
    time.sleep(seconds)
    # Forked, so that it may outlive this process where the cluster is kept.
    cluster.bed.spawn(part, ["setsid", "--fork", *command]).process.wait()
    wait_for(part, lambda: _answers(cluster), timeout=60, failed=lambda: None)


def _find(cluster: Cluster, part: str) -> tuple[int, list[str]]:
    """Process and command of a part; also of a cluster that another process has started."""
    bed = cluster.bed
    for process in leftovers.belonging(bed.netns, bed.folder):
        command = Path(f"/proc/{process}/cmdline").read_text().split("\0")[:-1]
        if command[1:2] == [part]:
            return process, command
    raise StartFailed(f"{part} does not run in the testbed {bed.name}")


def _answers(cluster: Cluster) -> bool:
    try:
        return cluster.kubectl("get", "--raw=/readyz") == "ok"
    except StartFailed:
        return False
