#!/usr/bin/env python3
"""What the start of our container beside a run costs, before it does anything.

    python tests/bench/agent_start.py [--repeat 12]

Starts `agent` in new processes, which end as the process that prepares their runs finds no plan: as
in the pods, with all of minio and with garbage collected meanwhile, with the docstrings of models,
and with a standard library that has no bytecode; and one that ends before it prepares anything, as
it comes too late. They alternate; prints the least CPU seconds of each with its child, and the most
memory of one process.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.base.docstrings import WITHOUT
from robovast.kubeapi.pod_contract.exit_codes import AgentExit

ARGUMENTS = ["agent", "--plan=/nowhere", "--message=/nowhere"]
START = ("-m", "robovast.agent")
UNAWARE = ("-c", "from robovast.agent.__main__ import main; raise SystemExit(main())")
"""Not as the program that is made to start sooner."""


def cost(start: Sequence[str], environment: dict[str, str], late: bool) -> tuple[float, float]:
    """CPU seconds, and the most memory [MiB]."""
    with TemporaryDirectory() as work:
        answers = Path(work, "out/.job")
        answers.mkdir(parents=True)
        if late:
            (answers / "terminated").touch()
        command = [sys.executable, *start, *ARGUMENTS, f"--work={work}"]
        process = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
    end = AgentExit.RUNS_LEFT if late else AgentExit.BAD_PLAN
    assert os.waitstatus_to_exitcode(status) == end
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=12)
    options = parser.parse_args()
    unset = {WITHOUT, "PYTHONDONTWRITEBYTECODE"}
    known = {name: value for name, value in os.environ.items() if name not in unset}
    with TemporaryDirectory() as complete, TemporaryDirectory() as partial:
        for cache in (complete, partial):
            cost(START, {**known, "PYTHONPYCACHEPREFIX": cache}, late=False)
        library = Path(os.path.realpath(sysconfig.get_path("stdlib")))
        for compiled in Path(partial, *library.parts[1:]).rglob("*.pyc"):
            if "site-packages" not in compiled.parts:
                compiled.unlink()
        described = {**known, "PYTHONPYCACHEPREFIX": complete}
        usual = {**described, WITHOUT: "true"}
        bare = {**usual, "PYTHONPYCACHEPREFIX": partial, "PYTHONDONTWRITEBYTECODE": "1"}
        cases = {
            "as in pods": (START, usual, False),
            "without what prepares": (START, usual, True),
            "with all of minio, and garbage collected": (UNAWARE, usual, False),
            "with docstrings": (START, described, False),
            "without bytecode of the standard library": (START, bare, False),
        }
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in cases}
        for _ in range(options.repeat):
            for name, case in cases.items():
                found[name].append(cost(*case))
    for name, costs in found.items():
        print(f"{name}: {min(costs)[0]:.3f} s CPU, {max(m for _, m in costs):.0f} MiB")
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} CPUs")


if __name__ == "__main__":
    main()
