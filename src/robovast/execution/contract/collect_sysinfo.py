"""Write what this machine is to a YAML file: `collect_sysinfo.py OUT_FILE`.

Runs in images of any origin at every start: standard library of Python 3.8, few imports.
"""

from __future__ import annotations

import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any


def read(path: str) -> str:
    """Return the text of a file, or an empty string when there is none."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return file.read().strip()
    except OSError:
        return ""


def platform_facts() -> dict[str, str]:
    """Return what `uname` says, under the names of the module `platform`."""
    kernel = os.uname()
    known = "CS_GNU_LIBC_VERSION" in os.confstr_names
    libc = ((known and os.confstr("CS_GNU_LIBC_VERSION")) or "libc").replace(" ", "")
    return {
        "platform": "-".join((kernel.sysname, kernel.release, kernel.machine, "with", libc)),
        "system": kernel.sysname,
        "release": kernel.release,
        "version": kernel.version,
        "machine": kernel.machine,
        "processor": kernel.machine,
    }


def cpu_name(cpuinfo: str) -> str:
    """Return the CPU's name out of the text of /proc/cpuinfo, empty when it has none."""
    for line in cpuinfo.splitlines():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model", "cpu model"):
            return value.strip()
    return ""


def cgroup_cpus() -> float:
    """Return the CPU quota of the cgroup (version 2 or 1) in CPUs; infinite when there is none."""
    version1 = "/sys/fs/cgroup/cpu/cpu.cfs_"
    limit = read("/sys/fs/cgroup/cpu.max") or read(version1 + "quota_us") + " " + read(
        version1 + "period_us"
    )
    quota, _, period = limit.partition(" ")
    return int(quota) / int(period) if quota.isdigit() else float("inf")


def available_cpus() -> float:
    """Return how many CPUs the job may use."""
    cpus = min(cgroup_cpus(), len(os.sched_getaffinity(0)))
    return int(cpus) if cpus == int(cpus) else cpus


def available_mem() -> int:
    """Return how many bytes of memory the job may use."""
    limits = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    for path in ("memory.max", "memory/memory.limit_in_bytes"):
        limit = read("/sys/fs/cgroup/" + path)
        if limit.isdigit():
            limits.append(int(limit))
    return min(limits)


def number(text: str) -> str | int | float:
    """Return a number where the text is one, else the text: `8Gi` stays what it is."""
    try:
        return int(text) if text.isdigit() else float(text)
    except ValueError:
        return text


def to_yaml(facts: dict[str, Any], indent: str = "") -> list[str]:
    """Return nested dictionaries of strings and numbers as YAML lines."""
    lines = []
    for key, value in facts.items():
        if isinstance(value, dict):
            lines += [indent + key + ":", *to_yaml(value, indent + "  ")]
        elif isinstance(value, str):
            lines.append(indent + key + ": '" + value.replace("'", "''") + "'")
        else:
            lines.append(indent + key + ": " + repr(value))
    return lines


def write(path: str) -> None:
    """Write the file; it appears complete or not at all."""
    facts = {
        "platform": platform_facts(),
        "cpu_name": cpu_name(read("/proc/cpuinfo")),
        "instance_type": os.environ.get("INSTANCE_TYPE", ""),
        "available_cpus": number(os.environ.get("AVAILABLE_CPUS", "")) or available_cpus(),
        "available_mem": number(os.environ.get("AVAILABLE_MEM", "")) or available_mem(),
    }
    with open(path + ".part", "w", encoding="utf-8") as file:
        file.write("\n".join(to_yaml(facts)) + "\n")
    os.replace(path + ".part", path)


if __name__ == "__main__":
    write(sys.argv[1])
