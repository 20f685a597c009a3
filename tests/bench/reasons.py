#!/usr/bin/env python3
"""Whether reasons say why runs failed.

    python tests/bench/reasons.py

Executes two runs of each of five causes in the example growth_sim: a population below its share, an
exception, a crash, a hang that the scenario's timeout ends, and one that `execution.timeout` ends.
Each run also writes harmless lines with numbers of its own to stderr. Prints how many of the ten
reasons name their cause, how many different reasons there are, and in how many groups they fall.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.campaign.failure_groups import failure_groups
from robovast.campaign.verdict import Verdict

EXAMPLE = Path(__file__).parents[2] / "configs" / "examples" / "growth_sim"
VAST = Path(sys.executable).with_name("vast")

CAUSES = {
    "below": "share below 0.9",
    "exception": "RuntimeError: sensor lost",
    "crash": "SIGSEGV",
    "hang": "stopped by the scenario's timeout",
    "stuck": "the limit of execution.timeout",
}
"""What the reason of each configuration must contain."""
FAULTS = """\
    import os, random, signal, time
    for number in range(20):
        note = f"[INFO] [1795389799.{number:09}] [follower]: a way of {random.random():.1f} m"
        print(note, file=sys.stderr, flush=True)
    fault = int(arguments.capacity) % 10
    if fault == 1:
        raise RuntimeError(f"sensor lost after {random.random():.2f} s")
    if fault == 2:
        os.kill(os.getpid(), signal.SIGSEGV)
    if fault == 3:
        time.sleep(60)
    if fault == 4:
        os.kill(os.getppid(), signal.SIGSTOP)
        time.sleep(60)
"""
BEGIN = "    population = simulate("


def broken_example(folder: Path) -> Path:
    """The example with a configuration for each cause; its capacity chooses the fault."""
    shutil.copytree(EXAMPLE, folder)
    program = folder / "files" / "growth_sim.py"
    program.write_text(program.read_text().replace(BEGIN, FAULTS + BEGIN, 1))
    scenario = folder / "scenario.osc"
    scenario.write_text(scenario.read_text().replace("timeout(30s)", "timeout(3s)"))
    entries = [
        {
            "name": name,
            "parameters": [{"expected": 0.9}, {"growth_rate": 0.02}],
            "variations": [
                {"ParameterVariationList": {"name": "capacity", "values": [1000 + fault]}}
            ],
        }
        for fault, name in enumerate(CAUSES)
    ]
    document = {
        "version": 1,
        "metadata": {"name": "causes"},
        "configuration": entries,
        "execution": {
            "scenario_file": "scenario.osc",
            "runs": 2,
            "timeout": 8,
            "run_files": ["files/*.py"],
        },
    }
    path = folder / "causes.vast"
    path.write_text(json.dumps(document))
    return path


def records(folder: Path) -> list[dict[str, str]]:
    """Records of the executed runs that did not pass."""
    path, out = broken_example(folder / "example"), folder / "results"
    command = [VAST, "-V", path, "exec", "local", "run", "--runtime", "process", out]
    subprocess.run(command, capture_output=True, check=False)
    return stored(out)


def stored(results: Path) -> list[dict[str, str]]:
    """Records of a results folder's runs that did not pass."""
    found = [json.loads(file.read_text()) for file in sorted(results.glob("*/*/*/run.json"))]
    return [record for record in found if record["verdict"] != Verdict.PASSED]


def report(found: list[dict[str, str]], causes: Mapping[str, str]) -> None:
    """Print the reasons, how many of them name their cause, and in how many groups they fall.

    Args:
        found: records of runs.
        causes: what the reason of each configuration must contain.
    """
    right = [record for record in found if causes[record["entry"]] in record["reason"]]
    for record in found:
        mark = "right" if record in right else "WRONG"
        sys.stdout.write(f"{mark}  {record['variant']}/{record['run']}  {record['reason']}\n")
    groups = failure_groups((r["id"], Verdict(r["verdict"]), r["reason"]) for r in found)
    reasons = len({record["reason"] for record in found})
    sys.stdout.write(
        f"{len(right)} of {len(found)} reasons name the cause; {reasons} different reasons, "
        f"{len(groups)} groups of {len(causes)} causes\n"
    )


def main() -> None:
    with TemporaryDirectory() as folder:
        report(records(Path(folder)), CAUSES)


if __name__ == "__main__":
    main()
