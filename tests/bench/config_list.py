#!/usr/bin/env python3
"""How long the command line takes before a user sees something.

    python tests/bench/config_list.py [--repeat 7]

Prints wall time (median, least, largest) and peak memory of `vast --help` and of `vast config
list` with 10, 10,000 and 100,000 configurations and of `vast config generate` with 10,000, each
over a bare `python -c pass` of the same session, and how far 100,000 are from ten times 10,000 in
CPU time, start-up left out. Last, `vast config generate` over a bare program that writes files of
the same sizes into as many folders, which is what the file system takes of it. All commands
alternate, so that they see the same machine.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

VAST = str(Path(sys.executable).with_name("vast"))

SCENARIO = "scenario drive:\n    speed: float = 1.0\n    distance: float = 5.0\n"

DOCUMENT = """\
version: 1
configuration:
- name: sweep
  variations:
  - ParameterVariationDistributionUniform: {{name: speed, num_variations: {0}, min: 0, max: 9}}
  - ParameterVariationDistributionUniform: {{name: distance, num_variations: {1}, min: 0, max: 9}}
execution:
  scenario_file: drive.osc
"""

WRITE_BARE = """\
import os, sys
root = sys.argv[1]
os.mkdir(root)
for number in range(10_000):
    os.mkdir(folder := f"{root}/{number}")
    os.mkdir(folder := f"{folder}/_config")
    for name, size in {"scenario.config": 66, "config.yaml": 516}.items():
        with open(f"{folder}/{name}", "wb", buffering=0) as file:
            file.write(b"x" * size)
"""

SIZES = {"10": (5, 2), "10,000": (100, 100), "100,000": (1000, 100)}


@dataclass
class Measured:
    """A command and what it took."""

    name: str
    command: list[str]
    goal: float | None = None
    """Largest wall time that is promised [s]."""
    output: Path | None = None
    """Folder that it makes, removed before."""
    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    """User and system time [s]."""
    memory: int = 0
    """Peak resident memory [KiB]."""

    def run(self) -> None:
        """Execute it once more."""
        if self.output is not None:
            shutil.rmtree(self.output, ignore_errors=True)
        begin = time.perf_counter()
        process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        self.wall.append(time.perf_counter() - begin)
        process.returncode = os.waitstatus_to_exitcode(status)
        assert process.returncode == 0, self.command
        self.cpu.append(usage.ru_utime + usage.ru_stime)
        self.memory = max(self.memory, usage.ru_maxrss)

    @property
    def median(self) -> float:
        """[s]"""
        return statistics.median(self.wall)

    def report(self, bare: float) -> None:
        """Print a line."""
        goal = f"  goal {self.goal} s" if self.goal else ""
        print(
            f"{self.name:<22} {self.median:.3f} s [{min(self.wall):.3f}–{max(self.wall):.3f}]  "
            f"{self.median / bare:.1f} × python  cpu {statistics.median(self.cpu):.3f} s  "
            f"{self.memory / 1024:.0f} MiB{goal}"
        )


def documents(folder: Path) -> dict[str, Path]:
    """A .vast file of each size."""
    (folder / "drive.osc").write_text(SCENARIO)
    files = {}
    for name, counts in SIZES.items():
        files[name] = folder / f"{counts[0]}x{counts[1]}.vast"
        files[name].write_text(DOCUMENT.format(*counts))
    return files


def generation(folder: Path) -> Measured:
    """Writing what a campaign of 10,000 configurations has before its first run."""
    output = folder / "out"
    command = [VAST, "-V", str(documents(folder)["10,000"]), "config", "generate", str(output)]
    return Measured("config generate 10,000", command, 2.0, output)


def bare_generation(folder: Path) -> Measured:
    """Writing as many files of the same sizes into as many folders, without anything else."""
    output = folder / "bare"
    command = [sys.executable, "-c", WRITE_BARE, str(output)]
    return Measured("the same files, bare", command, output=output)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=7)
    repeat = parser.parse_args().repeat
    with TemporaryDirectory() as name:
        lists = {
            size: Measured(f"config list {size}", [VAST, "-V", str(file), "config", "list"])
            for size, file in documents(Path(name)).items()
        }
        lists["10,000"].goal = 1.0
        bare = Measured("python -c pass", [sys.executable, "-c", "pass"])
        shown = [bare, Measured("vast --help", [VAST, "--help"], 0.25), *lists.values()]
        generated, files = generation(Path(name)), bare_generation(Path(name))
        shown += [generated, files]
        for measured in shown * (repeat + 1):
            measured.run()
    for measured in shown:
        del measured.wall[0], measured.cpu[0]  # caches of the file system
        measured.report(bare.median)
    start, small, large = (statistics.median(measured.cpu) for measured in lists.values())
    ratio = (large - start) / (small - start) / 10
    print(f"config generate over the same files, bare: {generated.median / files.median:.2f}")
    print(f"cpu of 100,000 over 10 × 10,000, both less that of 10: {ratio:.2f}")


if __name__ == "__main__":
    main()
