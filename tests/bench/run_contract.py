"""What the run contract costs: `python tests/bench/run_contract.py [RUNS]`.

Interleaves bare scenario-execution with the same run through `entrypoint.sh`, as a process, and
then runs packs of growing size. Prints medians; CPU is user and system time of all children.
"""

from __future__ import annotations

import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

from robovast.execution.contract import contract_files

SCENARIO = """
import osc.helpers

scenario try_it:
    program: string = "true"
    do serial:
        run_process(program)
"""
PROGRAMS = (
    Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    / "robovast-testbed/scenario-execution-1.8.0/bin"
)
"""The virtual environment that tests/integration/test_run_contract.py makes."""


def measure(command: list[str | Path], env: dict[str, str]) -> tuple[float, float]:
    """Wall and CPU seconds of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    subprocess.run(command, env=env, check=True, stdout=subprocess.DEVNULL)
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def show(name: str, samples: list[tuple[float, float]], runs: int = 1) -> tuple[float, float]:
    """Print and return the medians."""
    wall, cpu = (statistics.median(column) for column in zip(*samples, strict=True))
    print(
        f"{name:28} wall {wall:6.3f} s  CPU {cpu:6.3f} s"
        f"   per run {wall / runs * 1000:7.1f} ms, {cpu / runs * 1000:7.1f} ms"
    )
    return wall, cpu


def prepare(config: Path, runs: int, program: str) -> None:
    """Write the parameter documents of a pack."""
    documents = [
        {"try_it": {"program": program, "_output_dir": f"one/{index}"}} for index in range(runs)
    ]
    (config / "scenario.params.yaml").write_text(yaml.safe_dump_all(documents))


def main(rounds: int) -> None:
    """Print the costs."""
    root = Path(tempfile.mkdtemp())
    config, out = root / "config", root / "out"
    config.mkdir()
    (out / "one/0").mkdir(parents=True)
    for script in contract_files():
        shutil.copy(script, config)
    (config / "scenario.osc").write_text(SCENARIO)
    env = {
        "PATH": f"{PROGRAMS}:/usr/bin:/bin",
        "SCENARIO_FILE": "scenario.osc",
        "SCENARIO_PARAMETER_FILE": "scenario.params.yaml",
        "OUTPUT_DIR": str(out / "_jobs/job-0"),
        "SCENARIO_OUTPUT_DIR": str(out / "one/0"),
        "ENABLE_X11": "false",
        "ROBOVAST_CONFIG_DIR": str(config),
        "ROBOVAST_OUT_DIR": str(out),
    }
    bare: list[str | Path] = [
        PROGRAMS / "scenario_execution", "-o", out / "one/0", config / "scenario.osc",
        "--scenario-parameter-file", config / "scenario.params.yaml",
    ]  # fmt: skip
    contract: list[str | Path] = ["bash", config / "entrypoint.sh"]

    prepare(config, 1, "true")
    samples: dict[str, list[tuple[float, float]]] = {"bare": [], "contract": []}
    for _ in range(rounds):
        samples["bare"].append(measure(bare, env))
        samples["contract"].append(measure(contract, env))
    bare_wall, bare_cpu = show("bare scenario_execution", samples["bare"])
    wall, cpu = show("through the run contract", samples["contract"])
    print(
        f"{'own cost':28} wall {(wall - bare_wall) * 1000:.0f} ms, CPU"
        f" {(cpu - bare_cpu) * 1000:.0f} ms; ratio of wall {wall / bare_wall:.2f}\n"
    )
    env |= {"SCENARIO_OUTPUT_DIR": str(out), "OUTPUT_RESULT_PER_SCENARIO": "true"}
    costs = {}
    for program in ("true", "sleep 0.2"):
        for runs in (2, 26):
            prepare(config, runs, program)
            pack = [measure(contract, env) for _ in range(max(3, rounds // 4))]
            costs[runs] = show(f"pack of {runs}, `{program}`", pack, runs)[0]
        each = (costs[26] - costs[2]) / 24
        print(f"{'each further run':28} {each * 1000:.1f} ms\n")
    shutil.rmtree(root)


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 20)
