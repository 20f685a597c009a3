#!/usr/bin/env python3
"""What `vast results postprocess` costs when nothing, and when one run, has changed.

    python tests/bench/postprocess.py [--runs 10000] [--repeat 3]

A campaign of so many runs, each with a small bag, is postprocessed (poses, a topic), then again
without a change, then after one run was replaced. Wall and CPU time of the whole command, start-up
included, beside a bare walk over the same files (`os.scandir` and `stat`), which no cache that
notices changes can do without. Then the parts: commands, tables, metadata.
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

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.campaigns.bags import Bag
from support.campaigns.finished import finished_campaign

VAST = Path(sys.executable).with_name("vast")
COMMANDS = """\
  - rosbags_tf_to_csv: {frames: [base_link]}
  - rosbags_to_csv: {topics: [/text]}
"""
MESSAGES = 100


def make(folder: Path, runs: int) -> Path:
    """A campaign whose runs all have the same bag."""
    campaign = finished_campaign(folder / "results", runs, COMMANDS, runs_per_variant=10)
    template = folder / "template" / "rosbag2"
    with Bag(template) as bag:
        for at in range(MESSAGES):
            bag.write("/text", bag.make("std_msgs/msg/String", f"text {at}"), at)
        bag.transforms(
            bag.transform("map", "base_link", at, (at, 0.0, 0.0)) for at in range(MESSAGES)
        )
    for run in campaign.glob("*/[0-9]*"):
        shutil.copytree(template, run / "rosbag2")
    return campaign


def walk(folder: str) -> int:
    """Look at every file once; returns how many there are."""
    count = 0
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                count += walk(entry.path)
            else:
                entry.stat(follow_symlinks=False)
                count += 1
    return count


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """Wall and CPU time of this process and those that it waited for [s]."""

    def used() -> float:
        own = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        return sum(usage.ru_utime + usage.ru_stime for usage in own)

    begin, cpu = time.perf_counter(), used()
    work()
    return time.perf_counter() - begin, used() - cpu


def postprocess(campaign: Path, *options: str) -> None:
    command = [str(VAST), "-l", "error", "results", "postprocess", "-r", str(campaign.parent)]
    subprocess.run([*command, *options], check=True, capture_output=True)


def replace_run(campaign: Path, text: str) -> None:
    """Something changes in one run."""
    (campaign / "c-1" / "0" / "out.csv").write_text(f"v\n{text}\n")


def spread(values: list[tuple[float, float]]) -> str:
    wall, cpu = zip(*values, strict=True)
    return (
        f"{statistics.median(wall):.2f} s [{min(wall):.2f}–{max(wall):.2f}], "
        f"CPU {statistics.median(cpu):.2f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    with TemporaryDirectory() as name:
        campaign = make(Path(name), arguments.runs)
        bare = ["--skip-db", "--skip-metadata"]
        print(f"{arguments.runs} runs, {walk(str(campaign))} files before, {os.cpu_count()} CPUs")
        print("first, commands alone:", spread([timed(lambda: postprocess(campaign, *bare))]))
        print("first, tables:", spread([timed(lambda: postprocess(campaign, "--skip-metadata"))]))
        print("first, metadata:", spread([timed(lambda: postprocess(campaign))]))
        unchanged, walked, one, one_tables = [], [], [], []
        for turn in range(arguments.repeat):
            walked.append(timed(lambda: walk(str(campaign))))
            unchanged.append(timed(lambda: postprocess(campaign)))
            replace_run(campaign, f"a{turn}")
            one.append(timed(lambda: postprocess(campaign, *bare)))
            one_tables.append(timed(lambda: postprocess(campaign, "--skip-metadata")))
            postprocess(campaign)
        ratio = statistics.median(w for w, _ in unchanged) / statistics.median(w for w, _ in walked)
        print(f"a bare walk over {walk(str(campaign))} files:", spread(walked))
        print(f"unchanged: {spread(unchanged)}; {ratio:.2f} of the walk (goal 2 s)")
        print("one run changed, commands:", spread(one))
        print("then the tables:", spread(one_tables))


if __name__ == "__main__":
    main()
