#!/usr/bin/env python3
"""What RoboVAST adds to a run with nodes of ROS 2.

    python tests/bench/robot_runs.py [--repeat 3] [--select 'drive-?-1-?-2']

Executes drives of the example robot_navigation as plain processes one after another, in turns:
`scenario_execution` alone, `vast exec local run` with a job for each run, and with all runs in one
job. Prints wall and CPU time per run, median first, least and largest in brackets, and the ratio to
the bare runs; with `vast config list` for what a campaign costs once: the start of the command and
the expansion.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "configs" / "examples" / "robot_navigation"
DOCUMENT = EXAMPLE / "robot_navigation.vast"
VAST = Path(sys.executable).with_name("vast")

Times = tuple[float, float]
"""Wall time and CPU time of a command with all its children [s]."""


def timed(command: list[str | Path], codes: tuple[int, ...] = (0,)) -> Times:
    """Times of a command that must end with one of some exit codes."""
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in codes:
        raise SystemExit(f"{command} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    user, system = after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime
    return wall, user + system


def config_folders(folder: Path, select: str) -> list[Path]:
    """For each configuration what its runs find in the config folder."""
    generated = folder / "generated"
    command = [VAST, "-V", DOCUMENT, "config", "generate", generated]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    found = []
    for own in sorted(generated.glob(f"{select}/_config")):
        target = folder / "bare" / own.parent.name
        shutil.copytree(generated / "_config", target)
        shutil.copytree(own, target, dirs_exist_ok=True)
        found.append(target)
    return found


def bare(config: Path, environment: Path) -> Times:
    """One run of scenario_execution alone."""
    with TemporaryDirectory(dir=config.parent) as out:
        options = ["-o", out, "--scenario-parameter-file", config / "scenario.config"]
        program = environment / "bin" / "scenario_execution"
        return timed([program, *options, config / "scenario.osc"], codes=(0, 1))


def campaign(folder: Path, document: Path, select: str) -> Times:
    """All runs by RoboVAST, one after another."""
    with TemporaryDirectory(dir=folder) as out:
        options = ("--runtime", "process", "-j", "1", "-c", select)
        return timed([VAST, "-V", document, "exec", "local", "run", *options, out], codes=(0, 1))


def packed_document(folder: Path, runs: int) -> Path:
    """The example with all runs in one job."""
    target = folder / "packed"
    shutil.copytree(EXAMPLE, target)
    document = target / DOCUMENT.name
    text = document.read_text().replace("  runs: 1\n", f"  runs: 1\n  runs_per_job: {runs}\n")
    document.write_text(text)
    return document


def per_run(times: list[Times], runs: int) -> list[Times]:
    return [(wall / runs, cpu / runs) for wall, cpu in times]


def shown(times: list[Times]) -> str:
    def spread(values: list[float]) -> str:
        return f"{statistics.median(values):.2f} s [{min(values):.2f}–{max(values):.2f}]"

    walls, cpus = zip(*times, strict=True)
    return f"wall {spread(list(walls))}, CPU {spread(list(cpus))}"


def ratios(times: list[Times], base: list[Times]) -> str:
    wall, cpu = (
        statistics.median(t[i] for t in times) / statistics.median(t[i] for t in base)
        for i in (0, 1)
    )
    return f"{wall:.3f} of the bare wall time, {cpu:.3f} of the bare CPU time"


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--select", default="drive-?-1-?-2")
    given = parser.parse_args()
    made = subprocess.run(
        [ROOT / "scripts" / "ros-environment"],
        env={**os.environ, "PYTHON": sys.executable},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    environment = Path(made.stdout.strip())
    path = f"{environment / 'bin'}:{os.environ['PATH']}"
    os.environ |= {"ROBOVAST_PROCESS_ENV": str(environment), "PATH": path}
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # it makes each start compile all again
    with TemporaryDirectory(prefix="robovast-bench-") as name:
        folder = Path(name)
        configs = config_folders(folder, given.select)
        runs = len(configs)
        packed = packed_document(folder, runs)
        cases: dict[str, Callable[[], Times]] = {
            "bare": lambda: total([bare(config, environment) for config in configs]),
            "a job for each run": lambda: campaign(folder, DOCUMENT, given.select),
            "all runs in one job": lambda: campaign(folder, packed, given.select),
            "once": lambda: timed([VAST, "-V", DOCUMENT, "config", "list"]),
        }
        found: dict[str, list[Times]] = {case: [] for case in cases}
        for _ in range(given.repeat):
            for case, measure in cases.items():
                found[case].append(measure())
    once = found.pop("once")
    base = per_run(found.pop("bare"), runs)
    print(f"{runs} runs; bare run: {shown(base)}")
    print(f"`vast config list`, once for a campaign: {shown(once)}")
    less = tuple(statistics.median(t[i] for t in once) for i in (0, 1))
    for case, times in found.items():
        without = per_run([(wall - less[0], cpu - less[1]) for wall, cpu in times], runs)
        print(f"{case}: {shown(per_run(times, runs))}, {ratios(per_run(times, runs), base)}")
        print(f"    without what a campaign costs once: {shown(without)}, {ratios(without, base)}")


def total(times: list[Times]) -> Times:
    """Sums."""
    return sum(wall for wall, _ in times), sum(cpu for _, cpu in times)


if __name__ == "__main__":
    main()
