#!/usr/bin/env python3
"""What a campaign costs of which one configuration was edited, with `--reuse`.

    python tests/bench/reuse.py [--variants 500] [--seconds 20] [--jobs 40] [--output MB]

Executes a campaign of so many configurations, each of one run that sleeps and writes so much, as
plain processes; edits one configuration, and executes the campaign again with `--reuse`. The cost
is the time of the campaign multiplied by the jobs side by side.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

VAST = Path(sys.executable).with_name("vast")
SCENARIO = """\
import osc.helpers

scenario sleeper:
    x: int = 1
    here: common
    do serial:
        run_process("bash " + here.get_scenario_file_directory() + "/run.sh"
            + " %s " % x + here.get_output_directory())
"""
SCRIPT = """\
sleep {seconds}
echo "$1,$ROBOVAST_SEED" > "$2/out.csv"
head -c {size} /dev/urandom > "$2/bag.mcap"
"""
DOCUMENT = """\
version: 1
metadata: {{name: reuse}}
configuration:
- name: one
  variations:
  - ParameterVariationList: {{name: x, values: {values}}}
execution:
  scenario_file: scenario.osc
  run_files: [run.sh]
  seed: 7
"""


def execute(document: Path, jobs: int, *options: str) -> tuple[float, str]:
    """Time of a campaign [s], and the end of what it says."""
    out = document.parent / "out"
    begin = time.perf_counter()
    command = [VAST, "-V", document, "exec", "local", "run", out, "--runtime", "process"]
    done = subprocess.run(
        [*command, "-j", str(jobs), *options], capture_output=True, text=True, check=True
    )
    said = [line for line in done.stdout.splitlines() if "eused" in line or " runs: " in line]
    return time.perf_counter() - begin, "; ".join(said[-2:])


def main() -> None:
    parser = argparse.ArgumentParser(description="what an edited configuration costs")
    parser.add_argument("--variants", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--jobs", type=int, default=40)
    parser.add_argument("--output", type=float, default=1.0, help="what each run writes [MB]")
    given = parser.parse_args()
    with TemporaryDirectory(prefix="robovast-reuse-") as folder:
        document = Path(folder) / "reuse.vast"
        script = SCRIPT.format(seconds=given.seconds, size=int(given.output * 1e6))
        (document.parent / "run.sh").write_text(script)
        (document.parent / "scenario.osc").write_text(SCENARIO)
        values = list(range(given.variants))
        document.write_text(DOCUMENT.format(values=values))
        full, said = execute(document, given.jobs)
        print(f"all: {full:.1f} s with {given.jobs} side by side ({said})")
        values[given.variants // 2] = -1
        document.write_text(DOCUMENT.format(values=values))
        part, said = execute(document, 1, "--reuse")
        print(f"one edited: {part:.1f} s, one after the other ({said})")
        print(f"cost: 1/{full * given.jobs / part:.0f}")
        document.write_text(DOCUMENT.format(values=values))
        none, said = execute(document, 1, "--reuse")
        print(f"nothing edited: {none:.1f} s ({said})")


if __name__ == "__main__":
    main()
