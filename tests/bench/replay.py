#!/usr/bin/env python3
"""Whether a replay gives the run's own output again.

    python tests/bench/replay.py [--times 100] [--docker IMAGE | --cluster]

Executes growth_sim with noise, 20 runs of one configuration, and replays the first run so many
times with `vast replay`, as plain processes and, with an image, in Docker. Prints how many
different SHA-256 the runs' and the replays' `population.csv` have, and what a replay takes.

With `--cluster` so many runs of one configuration, each with its own seed, are executed on a real
node and as plain processes here, and the outputs of each run are compared.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

EXAMPLE = Path(__file__).parents[2] / "configs" / "examples" / "growth_sim"
VAST = Path(sys.executable).with_name("vast")
RUNS = 20


def noisy(folder: Path) -> Path:
    """The example, whose growth is noisy now; its document."""
    shutil.copytree(EXAMPLE, folder)
    path = folder / "growth_sim.vast"
    text = path.read_text().replace("growth_rate: 0.07", "growth_rate: 0.07\n  - noise: 0.3")
    path.write_text(text)
    return path


def vast(*arguments: object) -> str:
    """Standard output of a command, which may end with any code."""
    done = subprocess.run([VAST, *map(str, arguments)], capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def hashes(tables: Iterable[Path]) -> list[str]:
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in tables]


def measure(folder: Path, times: int, runtime: list[str]) -> None:
    """Run, replay and print."""
    document = noisy(folder / "in")
    campaign = ["exec", "local", "run", folder / "out", "-c", "fixed", "-r", RUNS, *runtime]
    vast("-V", document, *campaign)
    before = hashes(sorted((folder / "out").glob("*/fixed/*/population.csv")))
    (run,) = (folder / "out").glob("*/fixed/0")
    begin = time.perf_counter()
    said = vast("replay", run, "--times", times, "--out", folder / "again", "-j", 2)
    seconds = time.perf_counter() - begin
    again = hashes((folder / "again").glob("*/fixed/*/population.csv"))
    same = sum(one == hashes([run / "population.csv"])[0] for one in again)
    print(f"{' '.join(runtime)}: {len(set(before))} different outputs of {len(before)} runs")
    print(f"  {len(again)} replays of one run: {len(set(again))} different outputs,")
    print(
        f"  {same} equal to the run's; {seconds:.0f} s, {seconds / times:.2f} s each, two at once"
    )
    print("  " + said.strip().splitlines()[-3])


def compare_with_cluster(folder: Path, times: int) -> None:
    """Run the same runs here and there, and print how many outputs are equal."""
    from robovast_testbed import images
    from support.kube.lab import bench_lab

    document = noisy(folder / "in")
    text = document.read_text()
    document.write_text(text.replace("execution:\n", "execution:\n  seed: 7\n  runs_per_job: 20\n"))
    chosen = ["-c", "fixed", "-r", times]
    vast("-V", document, *("exec", "local", "run", folder / "out"), *chosen, "--runtime", "process")
    with bench_lab("replay") as lab:
        begin = time.perf_counter()
        said = lab.vast(
            *("-V", document, "exec", "cluster", "run", "-n", lab.namespace),
            *(*chosen, "--image", images.SLIM),
            code=None,
        ).stdout
        seconds = time.perf_counter() - begin
        home = lab.download(said.partition("Campaign ")[2].split()[0])
        here, there = (
            {
                path.parent.name: hashes([path])[0]
                for path in campaign.glob("fixed/*/population.csv")
            }
            for campaign in (next((folder / "out").iterdir()), home)
        )
    equal = sum(there.get(number) == found for number, found in here.items())
    print(f"cluster: {len(set(there.values()))} different outputs of {len(there)} runs")
    print(f"  {equal} equal to those of the same runs as plain processes; {seconds:.0f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description="whether a replay gives the same output")
    parser.add_argument("--times", type=int, default=100)
    parser.add_argument("--docker", metavar="IMAGE")
    parser.add_argument("--cluster", action="store_true")
    arguments = parser.parse_args()
    if arguments.cluster:
        with TemporaryDirectory(prefix="robovast-replay-") as folder:
            compare_with_cluster(Path(folder), arguments.times)
        return
    runtimes = [["--runtime", "process"]]
    if arguments.docker:
        runtimes.append(["--runtime", "docker", "--image", arguments.docker])
    for runtime in runtimes:
        with TemporaryDirectory(prefix="robovast-replay-") as folder:
            measure(Path(folder), arguments.times, runtime)


if __name__ == "__main__":
    main()
