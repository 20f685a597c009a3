#!/usr/bin/env python3
"""What RoboVAST adds to scenario-execution on this machine.

    python tests/bench/local_runs.py [--docker IMAGE] [--repeat 3]

Prints, from one session, the wall time of a growth_sim campaign (13 configurations × 2 runs) over
`26 × one bare run ÷ CPUs`, and over 26 bare runs that a thread pool starts, as many side by side as
there are CPUs (what this machine can do at best: side by side each run is slower than alone). For
plain processes, also in CPU time, and, with an image, for Docker. Then the split of a run in a pack
of 26, and what namespaces of its own cost a process. Bare and full executions alternate, so that
all see the same machine.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

import yaml

from robovast.base.atomic import put_in_place
from robovast.execution.local import sandbox
from robovast.execution.local.process_environment import process_environment
from robovast.model.quantities import machine_cpus

EXAMPLE = Path(__file__).parents[2] / "configs" / "examples" / "growth_sim"
RUNS = 26
VAST = Path(sys.executable).with_name("vast")


def timed(command: list[str], **options: object) -> float:
    """Wall time of a command that must succeed [s]."""
    begin = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, **options)  # type: ignore[call-overload]
    return time.perf_counter() - begin


def parameters(folder: Path) -> Path:
    path = folder / "bare.params.yaml"
    path.write_text(yaml.safe_dump({"growth": {"growth_rate": 0.07, "initial_population": 123}}))
    return path


def bare_process(folder: Path) -> float:
    """One run of scenario_execution alone [s]."""
    binaries = process_environment(print) / "bin"
    out = Path(mkdtemp(dir=folder))
    scenario = str(EXAMPLE / "scenario.osc")
    options = ["-o", str(out), "--scenario-parameter-file", str(parameters(folder)), scenario]
    environment = {**os.environ, "PATH": f"{binaries}:{os.environ['PATH']}"}
    return timed([str(binaries / "scenario_execution"), *options], env=environment)


def bare_docker(folder: Path, image: str) -> float:
    """One run of scenario_execution alone in a container [s]."""
    out = Path(mkdtemp(dir=folder))
    out.chmod(0o777)
    mounts = ["-v", f"{EXAMPLE}:/config:ro", "-v", f"{out}:/out", "-v", f"{folder}:/parameters:ro"]
    parameters(folder)
    call = ["scenario_execution", "-o", "/out", "/config/scenario.osc"]
    call += ["--scenario-parameter-file", "/parameters/bare.params.yaml"]
    return timed(["docker", "run", "--rm", *mounts, image, *call])


def campaign(folder: Path, *options: str, document: str = "growth_sim.vast") -> float:
    """The whole campaign, from the start of `vast` to its end [s]."""
    name = str(EXAMPLE / document)
    return timed([str(VAST), "-V", name, "exec", "local", "run", *options, "-o", str(folder)])


def side_by_side(bare_run: Callable[[], float]) -> float:
    """All runs by a thread pool, without RoboVAST [s]."""
    begin = time.perf_counter()
    with ThreadPoolExecutor(machine_cpus()) as pool:
        for future in [pool.submit(bare_run) for _ in range(RUNS)]:
            future.result()
    return time.perf_counter() - begin


def spread(values: list[float]) -> str:
    """Median, least and largest."""
    return f"{statistics.median(values):.2f} s [{min(values):.2f}–{max(values):.2f}]"


def cpu() -> float:
    """CPU time of all that has ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def compare(
    name: str,
    goals: tuple[float, float],
    repeat: int,
    bare_run: Callable[[], float],
    full_run: Callable[[], float],
) -> None:
    bare: list[float] = []
    limit: list[float] = []
    full: list[float] = []
    shares: list[float] = []
    for _ in range(repeat):
        bare += [bare_run() for _ in range(5)]
        begin = cpu()
        full.append(full_run())
        middle = cpu()
        limit.append(side_by_side(bare_run))
        shares.append((middle - begin) / (cpu() - middle))
    bare += [bare_run() for _ in range(5)]
    campaign_time = statistics.median(full)
    ideal = RUNS * statistics.median(bare) / machine_cpus()
    print(
        f"{name}: {campaign_time / ideal:.2f} of the ideal (goal {goals[0]}), "
        f"{campaign_time / statistics.median(limit):.2f} of the limit (goal {goals[1]}), "
        f"{statistics.median(shares):.2f} of its CPU; campaign {spread(full)}, "
        f"bare run {spread(bare)}, {RUNS} bare runs side by side {spread(limit)}, "
        f"{machine_cpus()} CPUs, load {os.getloadavg()[0]:.1f}"
    )


def packed(folder: Path, repeat: int) -> None:
    """Cost of a run in a pack of 26: the scenario's own time, and the rest."""
    text = (EXAMPLE / "growth_sim.vast").read_text()
    source = folder / "packed"
    subprocess.run(["cp", "-r", str(EXAMPLE), str(source)], check=True)
    document = source / "packed.vast"
    document.write_text(text.replace("  runs: 2\n", f"  runs: 2\n  runs_per_job: {RUNS}\n"))
    total, own = [], []
    for index in range(repeat):
        out = folder / f"packed-{index}"
        command = [str(VAST), "-V", str(document), "exec", "local", "run", "--runtime", "process"]
        total.append(timed([*command, "-o", str(out)]) / RUNS)
        results = [path.read_text() for path in out.glob("*/*/*/test.xml")]
        times = [float(re.search(r'<testsuite[^>]* time="([^"]+)"', text)[1]) for text in results]  # type: ignore[index]
        own.append(statistics.mean(times))
    each, scenario = statistics.median(total), statistics.median(own)
    print(
        f"packed: {each:.3f} s per run, of which the scenario itself {scenario:.3f} s; "
        f"{each - scenario:.3f} s for all else (start-up of the job, {RUNS} verdicts, records)"
    )


def isolation(folder: Path, repeat: int) -> None:
    """What namespaces of its own cost a process."""
    out = folder / "isolated"
    out.mkdir()
    for name in filter(shutil.which, sandbox.LAUNCHERS):
        box = sandbox.Sandbox(sandbox.LAUNCHERS[name], [])
        isolated = box.command(out, {"/config": out, "/out": out}, ["true"])
        wall: dict[str, list[float]] = {"bare": [], "isolated": []}
        used = dict.fromkeys(wall, 0.0)
        for _ in range(40 * repeat):
            for case, command in {"bare": ["true"], "isolated": isolated}.items():
                begin = cpu()
                wall[case].append(timed(command))
                used[case] += cpu() - begin
        more = statistics.median(wall["isolated"]) - statistics.median(wall["bare"])
        least = min(wall["isolated"]) - min(wall["bare"])
        cpu_time = (used["isolated"] - used["bare"]) / len(wall["bare"])
        print(
            f"isolation by {name}: {more * 1000:.1f} ms (goal 15), least {least * 1000:.1f} ms, "
            f"CPU {cpu_time * 1000:.1f} ms; load {os.getloadavg()[0]:.1f}"
        )


def storing(folder: Path, repeat: int) -> None:
    """What it costs that a run which was told to be stored survives a power cut."""
    times: dict[str, list[float]] = {"synced": [], "unsynced": []}
    real = os.fsync
    for number in range(40 * repeat):
        for case in times:
            source = folder / f"{case}-{number}"
            source.mkdir()
            for name in ("test.xml", "run.json", "population.csv"):
                (source / name).write_bytes(os.urandom(4096))
            os.fsync = real if case == "synced" else lambda _: None
            begin = time.perf_counter()
            put_in_place(source, folder / "stored" / case / str(number))
            times[case].append((time.perf_counter() - begin) * 1000)
    os.fsync = real
    most = max(times["synced"])
    synced, unsynced = (statistics.median(values) for values in times.values())
    print(
        f"storing a run of 3 files: {synced:.2f} ms [at most {most:.1f}], without `fsync` "
        f"{unsynced:.2f} ms; load {os.getloadavg()[0]:.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docker", metavar="IMAGE")
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        compare(
            "process",
            (1.10, 1.05),
            arguments.repeat,
            lambda: bare_process(folder),
            lambda: campaign(folder / "process", "--runtime", "process"),
        )
        packed(folder, arguments.repeat)
        isolation(folder, arguments.repeat)
        storing(folder, arguments.repeat)
        if arguments.docker:
            image = arguments.docker
            compare(
                "docker",
                (1.5, 1.15),
                arguments.repeat,
                lambda: bare_docker(folder, image),
                lambda: campaign(folder / "docker", "--runtime", "docker", "--image", image),
            )


if __name__ == "__main__":
    main()
