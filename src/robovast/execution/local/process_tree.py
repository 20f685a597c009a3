"""Stops a program together with everything that it started."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import time
from pathlib import Path

MARKER = "ROBOVAST_JOB"
"""Environment variable of all processes of a job; finds those that left the process group."""


AGAIN = 5.0
"""After how long a request to end is repeated [s]: bash ignores it while it sets a trap for it."""


def wait(process: subprocess.Popen[bytes], timeout: float) -> bool:
    """Wait at most `timeout` seconds for the end of a process; return True if it ended.

    `Popen.wait(timeout)` polls at growing intervals; the kernel reports the end immediately.
    """
    if process.poll() is not None:
        return True
    try:
        descriptor = os.pidfd_open(process.pid)
    except (AttributeError, OSError):  # not Linux, or gone in between
        time.sleep(min(timeout, 0.05))
        return process.poll() is not None
    try:
        poller = select.poll()
        poller.register(descriptor, select.POLLIN)
        poller.poll(timeout * 1000)
    finally:
        os.close(descriptor)
    return process.poll() is not None


def stop(process: subprocess.Popen[bytes], grace: float) -> None:
    """Terminate a process (leader of its own group); kill it after `grace` seconds."""
    _signal_group(process.pid, signal.SIGTERM)
    if not wait(process, grace):
        _signal_group(process.pid, signal.SIGKILL)
        process.wait()


def stop_launched(process: subprocess.Popen[bytes], grace: float) -> None:
    """Do the same with the first process of a namespace, whose end ends all others in it.

    The given process only started that one, and ends when all have ended.
    """
    deadline = time.monotonic() + grace
    asked = False
    while not asked and time.monotonic() < deadline and not wait(process, 0.01):
        asked = any(map(_ask, _children(process.pid)))
    if wait(process, max(0.0, min(AGAIN, deadline - time.monotonic()))):
        return
    any(map(_ask, _children(process.pid)))
    if wait(process, max(0.0, deadline - time.monotonic())):
        return
    for pid in _children(process.pid):
        _signal(pid, signal.SIGKILL)
    if not wait(process, grace):
        _signal_group(process.pid, signal.SIGKILL)
        process.wait()


def _ask(pid: int) -> bool:
    """Terminate a process once it handles the signal, which a namespace's first may ignore."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
    caught = int(status.partition("SigCgt:")[2].split()[0], 16)
    listens = bool(caught >> (signal.SIGTERM - 1) & 1)
    if listens:
        _signal(pid, signal.SIGTERM)
    return listens


def _children(pid: int) -> list[int]:
    try:
        return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def kill_marked(token: str) -> None:
    """Kill every process whose token has this prefix, whatever its group."""
    for _ in range(5):  # repeated for processes started meanwhile
        found = _marked(token)
        if not found:
            return
        for pid in found:
            _signal(pid, signal.SIGKILL)
        time.sleep(0.02)


def _marked(token: str) -> list[int]:
    entry = f"\0{MARKER}={token}".encode()
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit() or int(folder.name) == os.getpid():
            continue
        try:
            environment = (folder / "environ").read_bytes()
            stopped = (folder / "stat").read_text().rpartition(")")[2].split()[0] in "ZX"
        except OSError:  # another user's, or ended
            continue
        if entry in b"\0" + environment and not stopped:
            found.append(int(folder.name))
    return found


def _signal_group(leader: int, number: signal.Signals) -> None:
    try:
        os.killpg(leader, number)
    except ProcessLookupError:
        pass
    except PermissionError:
        _signal(leader, number)


def _signal(pid: int, number: signal.Signals) -> None:
    try:
        os.kill(pid, number)
    except (ProcessLookupError, PermissionError):
        return
