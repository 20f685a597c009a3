"""Sample the CPU and memory of processes once a second.

    monitor_resources.py OUT_CSV [--root-pid PID]

Watches every process it can see, or, with a root, that process and its descendants (also those
that lost their parent since they were first seen). Ends on SIGTERM, after a last sample, or when
its parent has gone. Runs in images of any origin: standard library of Python 3.8, few imports.

Columns: timestamp [s since the epoch], pid, name, cpu_percent [% of one CPU since the last
sample, or since the process began], memory_rss_bytes.
"""

from __future__ import annotations

import os
import signal
import sys
import time

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Collection
    from typing import TextIO

    Identity = tuple[int, float]
    Usage = tuple[float, float]

HEADER = "timestamp,pid,name,cpu_percent,memory_rss_bytes\n"
PERIOD = 1.0
TICKS = os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")


class Process:
    """One line of /proc/PID/stat."""

    __slots__ = ("began", "cpu", "name", "parent", "pid", "rss")

    def __init__(self, stat: str) -> None:
        """Parse; the name stands in parentheses and may itself hold any character."""
        head, _, tail = stat.rpartition(")")
        pid, _, self.name = head.partition(" (")
        fields = tail.split()
        self.pid = int(pid)
        self.parent = int(fields[1])
        self.cpu = (int(fields[11]) + int(fields[12])) / TICKS
        self.began = int(fields[19]) / TICKS
        self.rss = int(fields[21]) * PAGE

    @property
    def identity(self) -> Identity:
        """Tell two processes apart that had the same pid one after the other."""
        return self.pid, self.began


def processes() -> dict[int, Process]:
    """Return all processes by pid; one that ends meanwhile is left out."""
    found = {}
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                with open("/proc/" + entry + "/stat", "rb") as file:
                    found[int(entry)] = Process(file.read().decode("utf-8", "replace"))
            except (FileNotFoundError, ProcessLookupError):
                pass
    return found


def family(everyone: dict[int, Process], root: int, known: Collection[Identity]) -> list[Process]:
    """Return the processes that descend from `root`, or that did when last seen (`known`)."""
    belongs = {root: True, 0: False}

    def is_member(pid: int) -> bool:
        if pid not in belongs:
            process = everyone.get(pid)
            belongs[pid] = process is not None and (
                process.identity in known or is_member(process.parent)
            )
        return belongs[pid]

    return [process for pid, process in everyone.items() if is_member(pid)]


def row(process: Process, now: float, uptime: float, last: Usage | None) -> str:
    """Return the CSV line of a process; `last` is its (cpu, uptime) in the sample before."""
    cpu, since = last or (0.0, process.began)
    percent = 100.0 * (process.cpu - cpu) / max(uptime - since, 1.0 / TICKS)
    name = process.name
    if any(character in name for character in ',"\r\n'):
        name = '"' + name.replace('"', '""') + '"'
    return f"{now:.3f},{process.pid},{name},{percent:.1f},{process.rss}\n"


def sample(file: TextIO, root: int | None, last: dict[Identity, Usage]) -> dict[Identity, Usage]:
    """Write one sample; return what the next one needs: (cpu, uptime) of each process."""
    everyone = processes()
    watched = list(everyone.values()) if root is None else family(everyone, root, last)
    now = time.time()
    uptime = time.clock_gettime(time.CLOCK_BOOTTIME)
    file.write("".join(row(one, now, uptime, last.get(one.identity)) for one in watched))
    file.flush()
    return {one.identity: (one.cpu, uptime) for one in watched}


def main() -> None:
    """Sample until told to stop."""
    root = int(sys.argv[3]) if sys.argv[2:3] == ["--root-pid"] else None
    parent = os.getppid()
    stop = (signal.SIGTERM, signal.SIGINT)
    signal.pthread_sigmask(signal.SIG_BLOCK, stop)
    with open(sys.argv[1], "a", encoding="utf-8") as file:
        if not file.tell():
            file.write(HEADER)
        last: dict[Identity, Usage] = {}
        told = None
        while not told and os.getppid() == parent:
            last = sample(file, root, last)
            told = signal.sigtimedwait(stop, PERIOD)
        sample(file, root, last)


if __name__ == "__main__":
    main()
