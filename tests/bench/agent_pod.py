#!/usr/bin/env python3
"""What our container beside a run costs from its start to its end.

    python tests/bench/agent_pod.py [--repeat 12] [--beside SOURCES]

Executes pods of one trivial run as plain processes beside a MinIO of the testbed: `agent` with the
process that prepares the run, and the scripts and the run in place of the other container. Prints
the CPU seconds of `agent` and, where control groups can be made, the most memory of both processes,
which these take of the pod; both also with other sources of RoboVAST (a folder `src`), in turns.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from robovast_testbed import bed, network, s3  # noqa: E402
from support.campaigns.local import make_campaign  # noqa: E402
from support.kube.pod_processes import Campaign, Pod  # noqa: E402

from robovast.base.docstrings import WITHOUT  # noqa: E402

GROUPS = Path("/sys/fs/cgroup/memory")
SILENCE = 1800
"""As the operator orders it by default [s]."""


class Group:
    """A control group of memory for the processes that are started meanwhile."""

    def __init__(self) -> None:
        self._folder = GROUPS / f"agent-pod-{os.getpid()}"

    @contextmanager
    def around(self) -> Iterator[None]:
        """Start processes in it, if it can be made."""
        if not (GROUPS / "cgroup.procs").exists() or os.geteuid():
            yield
            return
        name = next(
            line.split(":")[2]
            for line in Path("/proc/self/cgroup").read_text().splitlines()
            if line.split(":")[1] == "memory"
        )
        self._folder.mkdir()
        self._enter(self._folder)
        try:
            yield
        finally:
            self._enter(GROUPS / name.lstrip("/"))

    def _enter(self, folder: Path) -> None:
        (folder / "cgroup.procs").write_text(str(os.getpid()))

    def end(self) -> float:
        """Remove it; the most memory that its processes had [MiB], or 0."""
        if not self._folder.exists():
            return 0.0
        most = int((self._folder / "memory.max_usage_in_bytes").read_text()) / 2**20
        self._folder.rmdir()
        return most


def cost(campaign: Campaign, sources: Path | None) -> tuple[float, float]:
    """CPU seconds of the agent of a pod, and its most memory [MiB]."""
    os.environ.pop("PYTHONPATH", None)
    if sources is not None:
        os.environ["PYTHONPATH"] = str(sources)
    pod, group = Pod(campaign), Group()
    run = pod.start_run()
    with group.around():
        agent = pod.command("agent", f"--silence={SILENCE}", index=0)
    _, status, used = os.wait4(agent.pid, 0)
    agent.returncode = os.waitstatus_to_exitcode(status)
    assert agent.returncode == 0, pod.message_file.read_text()
    assert run.wait(60) == 0
    return used.ru_utime + used.ru_stime, group.end()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=12)
    parser.add_argument("--beside", type=Path, metavar="SOURCES")
    options = parser.parse_args()
    os.environ[WITHOUT] = "true"
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    cases = {"these sources": None, **({"those": options.beside} if options.beside else {})}
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in cases}
    with bed.session("agent-pod") as own, TemporaryDirectory() as folder:
        os.environ["PYTHONPYCACHEPREFIX"] = str(Path(folder, "bytecode"))
        network.create_bridge(own)
        server = s3.start(own, "minio")
        vast = make_campaign(Path(folder, "source"), "true\n")
        for number in range(options.repeat + 1):
            for name, sources in cases.items():
                campaign = Campaign(Path(folder, f"{name.split()[0]}-{number}"), vast, server)
                try:
                    costs = cost(campaign, sources)
                finally:
                    campaign.close()
                if number:  # the first one compiles
                    found[name].append(costs)
    for name, costs in found.items():
        cpu = [seconds for seconds, _ in costs]
        memory = statistics.median(most for _, most in costs)
        spread = f"[{min(cpu):.3f}–{max(cpu):.3f}]"
        print(f"{name}: {statistics.median(cpu):.3f} s CPU {spread}, {memory:.0f} MiB")
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} CPUs")


if __name__ == "__main__":
    main()
