"""Sample the CPU and memory of processes once a second.

    monitor_resources.py OUT_CSV [--root-pid PID] [--sysinfo OUT_YAML]

Watches every process it can see, or, with a root, that process and its descendants (also those
that lost their parent since they were first seen). Ends on SIGTERM, after a last sample, or when
its parent has gone. Says first what the machine is, when told where (see collect_sysinfo.py), to
save the start of another interpreter. Runs in images of any origin: standard library of Python 3.8,
few imports.

Columns: timestamp [s since the epoch], pid, name, cpu_percent [% of one CPU since the last
sample, or since the process began], memory_rss_bytes.
"""

from __future__ import annotations

import os
import sys
import time

TYPE_CHECKING = False
if TYPE_CHECKING:
    import signal
    from collections.abc import Iterable
    from typing import TextIO

    Identity = tuple[int, float]
    Usage = tuple[float, float]
else:
    import _signal as signal  # its enumerations alone would double the time of every start

HEADER = "timestamp,pid,name,cpu_percent,memory_rss_bytes\n"
PERIOD = 1.0
TICKS = os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")


class ProcessStat:
    """One line of /proc/PID/stat."""

    __slots__ = ("began", "cpu", "is_over", "name", "pid", "rss")

    def __init__(self, stat: str) -> None:
        """Parse; the name stands in parentheses and may itself hold any character."""
        head, _, tail = stat.rpartition(")")
        pid, _, self.name = head.partition(" (")
        fields = tail.split()
        self.pid = int(pid)
        self.is_over = fields[0] == "Z"  # only its parent has not asked for its exit code
        self.cpu = (int(fields[11]) + int(fields[12])) / TICKS
        self.began = int(fields[19]) / TICKS
        self.rss = int(fields[21]) * PAGE

    @property
    def identity(self) -> Identity:
        """Tell two processes apart that had the same pid one after the other."""
        return self.pid, self.began


def all_pids() -> list[int]:
    """Return every process that can be seen."""
    return [int(entry) for entry in os.listdir("/proc") if entry.isdigit()]


def family(pids: Iterable[int]) -> list[int]:
    """Return processes and their descendants, as far as they exist."""
    found: dict[int, None] = {}
    pending = list(pids)
    while pending:
        pid = pending.pop()
        if pid not in found:
            found[pid] = None
            pending += children(pid)
    return list(found)


def children(pid: int) -> list[int]:
    """Return the children of all threads of a process."""
    tasks = f"/proc/{pid}/task"
    found: list[int] = []
    try:
        for task in os.listdir(tasks):
            with open(f"{tasks}/{task}/children", "rb") as file:
                found += map(int, file.read().split())
    except (FileNotFoundError, ProcessLookupError):
        pass
    return found


def processes(pids: Iterable[int]) -> list[ProcessStat]:
    """Return the processes; one that ends meanwhile is left out."""
    found = []
    for pid in pids:
        try:
            with open(f"/proc/{pid}/stat", "rb") as file:
                found.append(ProcessStat(file.read().decode("utf-8", "replace")))
        except (FileNotFoundError, ProcessLookupError):
            pass
    return found


def row(process: ProcessStat, now: float, uptime: float, last: Usage | None) -> str:
    """Return the CSV line of a process; `last` is its (cpu, uptime) in the sample before."""
    cpu, since = last or (0.0, process.began)
    percent = 100.0 * (process.cpu - cpu) / max(uptime - since, 1.0 / TICKS)
    name = process.name
    if any(character in name for character in ',"\r\n'):
        name = '"' + name.replace('"', '""') + '"'
    return f"{now:.3f},{process.pid},{name},{percent:.1f},{process.rss}\n"


def sample(file: TextIO, root: int | None, last: dict[Identity, Usage]) -> dict[Identity, Usage]:
    """Write one sample; return what the next one needs: (cpu, uptime) of each process."""
    if root is None:
        watched = processes(all_pids())
    else:  # an orphan is still ours, one that reuses its pid is not
        orphans = [one for one in processes(pid for pid, _ in last) if one.identity in last]
        watched = processes(family([root, *(one.pid for one in orphans)]))
    watched = [one for one in watched if not one.is_over]
    now = time.time()
    uptime = time.clock_gettime(time.CLOCK_BOOTTIME)
    file.write("".join(row(one, now, uptime, last.get(one.identity)) for one in watched))
    file.flush()
    return {one.identity: (one.cpu, uptime) for one in watched}


def main() -> None:
    """Sample until told to stop."""
    words = iter(sys.argv[2:])
    options = {name: next(words) for name in words}
    root = int(options["--root-pid"]) if "--root-pid" in options else None
    parent = os.getppid()
    stop = (signal.SIGTERM, signal.SIGINT)
    signal.pthread_sigmask(signal.SIG_BLOCK, stop)
    if "--sysinfo" in options:
        sys.path.append(os.path.dirname(os.path.abspath(__file__)))
        __import__("collect_sysinfo").write(options["--sysinfo"])
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
