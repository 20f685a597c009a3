"""Find and remove what a testbed leaves in the kernel: processes, mounts, cgroups."""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from .commands import run
from .errors import StartFailed

CGROUPS = Path("/sys/fs/cgroup")


def kill(netns: Path, folder: Path, *, timeout: float = 60.0) -> None:
    """Kill every process in the network namespace or with its root file system in the folder.

    This process and its ancestors are spared.

    :param timeout: in seconds.
    :raises StartFailed: when some process survives for that long.
    """
    deadline = time.monotonic() + timeout
    spared = set(_ancestors())
    while alive := [pid for pid in belonging(netns, folder) if pid not in spared]:
        if time.monotonic() > deadline:
            raise StartFailed(f"processes {alive} of {folder.name} survive SIGKILL")
        for pid in alive:
            _kill_if(pid, netns, folder)
        time.sleep(0.05)


def unmount(folder: Path) -> None:
    """Unmount everything under the folder, the deepest first."""
    inside = [point for point in _mount_points() if point.is_relative_to(folder)]
    for point in sorted(inside, key=lambda p: len(p.parts), reverse=True):
        run(["umount", "--lazy", point])


def remove_cgroups(name: str) -> None:
    """Remove the (empty) cgroups of this name from every hierarchy."""
    for hierarchy in (CGROUPS, *CGROUPS.iterdir()):
        top = hierarchy / name.lstrip("/")
        for folder, _, _ in os.walk(top, topdown=False):
            with suppress(FileNotFoundError):
                os.rmdir(folder)


def belonging(netns: Path, folder: Path) -> Iterator[int]:
    """Return the processes in the network namespace or with their root in the folder."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and _belongs(entry, netns, folder):
            yield int(entry.name)


def _belongs(process: Path, netns: Path, folder: Path) -> bool:
    with suppress(OSError):  # it may end at any moment, and a zombie has no namespaces
        namespace = (process / "ns/net").stat()
        if netns.exists() and os.path.samestat(namespace, netns.stat()):
            return True
        mounts = (process / "mountinfo").read_text().splitlines()
        return any(line.split()[4] == "/" and f"={folder}/" in line for line in mounts)
    return False


def _kill_if(pid: int, netns: Path, folder: Path) -> None:
    """Kill the process if it still is one of the testbed's (an id may have been reused)."""
    with suppress(ProcessLookupError):
        handle = os.pidfd_open(pid)
        try:
            if _belongs(Path(f"/proc/{pid}"), netns, folder):
                signal.pidfd_send_signal(handle, signal.SIGKILL)
        finally:
            os.close(handle)


def _ancestors() -> Iterator[int]:
    pid = os.getpid()
    while pid > 0:
        yield pid
        status = Path(f"/proc/{pid}/status").read_text()
        pid = next(int(line.split()[1]) for line in status.splitlines() if line[:5] == "PPid:")


def _mount_points() -> list[Path]:
    lines = Path("/proc/self/mountinfo").read_text().splitlines()
    return [Path(line.split()[4].encode().decode("unicode_escape")) for line in lines]
