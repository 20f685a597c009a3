#!/usr/bin/env python3
"""Campaigns whose every run's right verdict is known, on a cluster that suffers faults at random.

    python tests/bench/gauntlet.py --minutes 120 --seed 1

Brings up a real node with RoboVAST installed by its chart, makes campaigns and does faults for so
long, repairs everything, waits until all campaigns have ended, and compares what is left with the
truth. What is done follows from the seed; when exactly it hits whom does not. The exit code is 0
when nothing was lost, repeated, misjudged or mixed.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(TESTS / part) for part in (".", "testbed")]

from robovast_testbed import bed, controlplane, images, node, outages  # noqa: E402
from robovast_testbed.errors import StartFailed  # noqa: E402
from robovast_testbed.kubernetes import Cluster  # noqa: E402
from support.gauntlet.entrants import Deed, Entrant  # noqa: E402
from support.gauntlet.faults import FAULTS, Arena  # noqa: E402
from support.gauntlet.jury import executions, judge  # noqa: E402
from support.gauntlet.play import Gauntlet  # noqa: E402
from support.gauntlet.verdict import Fault, Violation  # noqa: E402
from support.gauntlet.watch import Watch  # noqa: E402
from support.kube.lab import EMBEDDED, SYSTEM, Lab, install, make_lab  # noqa: E402

NAMESPACES = ("north", "south")
NODE_DISK = "/var/lib/kubelet"
LOGS = "/var/log/pods"
KEPT = "pods"
"""The testbed's folder for logs of pods that are gone."""


def add_disk(own: bed.Bed, folder: str | Path, size: str) -> None:
    """A small disk of its own, which can be full."""
    own.run("mount", "-t", "tmpfs", "-o", f"size={size},mode=777", "tmpfs", folder)


@contextmanager
def arena(folder: Path) -> Iterator[tuple[Arena, list[Lab], Path]]:
    """A cluster with RoboVAST, places for campaigns, and the trace of their executions."""
    with bed.session(f"gauntlet-{os.getpid()}") as own:
        cluster = controlplane.start(own)
        for index in range(controlplane.VOLUMES):
            add_disk(own, cluster.folder / "volumes" / str(index), "600m")
        add_disk(own, NODE_DISK, "600m")
        node.start(cluster, [images.archive()])
        install(cluster, EMBEDDED)
        cluster.kubectl(
            *("--namespace", SYSTEM, "scale", "deployment/robovast-page", "--replicas=0")
        )
        trace = own.folder / "trace"
        trace.touch()
        program = [sys.executable, TESTS / "support/gauntlet/executions.py", trace]
        sink = own.spawn("trace", ["env", f"PYTHONPATH={TESTS}", *program])
        for name in NAMESPACES:
            (folder / name).mkdir()
        labs = [make_lab(cluster, name, folder / name) for name in NAMESPACES]
        files = Path(f"/proc/{_inside(cluster, sink.process.pid)}/root")
        volume = cluster.kubectl("get", "persistentvolumes", "--output=json")
        (bound,) = (
            item["spec"]["hostPath"]["path"]
            for item in json.loads(volume)["items"]
            if item["status"]["phase"] == "Bound"
        )
        yield Arena(cluster, files, files / bound.lstrip("/"), NAMESPACES), labs, trace


def _inside(cluster: Cluster, pid: int) -> int:
    """The process itself: what was started is nsenter, which becomes it."""
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        found = outages.processes(cluster.bed, lambda c: any("gauntlet/executions" in w for w in c))
        if any(process.pid == pid for process in found):
            return pid
        time.sleep(0.1)
    raise StartFailed("the trace of executions does not start")


def report(
    entrants: Sequence[Entrant],
    faults: Counter[str],
    executed: int,
    violations: Sequence[Violation],
) -> None:
    deeds = Counter(deed for entrant in entrants for deed in entrant.done)
    runs = sum(len(entrant.course.truth()) for entrant in entrants)
    ended = sum(len(e.course.truth()) for e in entrants if e.finished)
    twins = len(entrants) - len({entrant.name for entrant in entrants})
    print(f"\ncampaigns {len(entrants)} ({twins} with a twin of one name and second)")
    print(f"runs {runs}, {ended} of them of campaigns that ended; executions {executed}")
    print(f"faults {faults.total()} of {len(faults)} kinds")
    for name in FAULTS:
        print(f"  {faults[name]:4} {name}")
    print("deeds " + ", ".join(f"{deeds[deed]} {deed}" for deed in Deed))
    for violation in violations:
        print(violation)
    for fault in Fault:
        print(f"runs {fault}: {len({v.where for v in violations if v.fault is fault})}")


def keep_evidence(where: Arena, home: Path, trace: Path, evidence: Path) -> None:
    """Copy what tells how it came to that."""
    evidence.mkdir(parents=True, exist_ok=True)
    own = where.cluster.bed.folder
    shutil.copytree(own / "logs", evidence / "logs", dirs_exist_ok=True)
    shutil.copytree(own / KEPT, evidence / "pods", dirs_exist_ok=True)
    shutil.copytree(where.storage / "buckets", evidence / "buckets", dirs_exist_ok=True)
    shutil.copytree(home, evidence / "home", symlinks=True, dirs_exist_ok=True)
    shutil.copy(trace, evidence / "trace")
    kinds = ",".join(("campaigns", "configurations", "jobs", "pods", "configmaps", "events"))
    text = where.cluster.kubectl("get", kinds, "--all-namespaces", "--output=json")
    (evidence / "objects.json").write_text(text)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--alive", type=int, default=3, help="campaigns at once")
    parser.add_argument("--pause", type=float, default=6, help="seconds between two faults")
    parser.add_argument("--evidence", type=Path, help="folder for logs, when something is wrong")
    options = parser.parse_args(arguments)
    with TemporaryDirectory() as folder, arena(Path(folder)) as (where, labs, trace):
        gauntlet = Gauntlet(where, labs, Random(options.seed), options.alive)  # noqa: S311
        own = where.cluster.bed
        with Watch(where.storage / "buckets", own.private(LOGS), own.folder / KEPT) as watch:
            faults = gauntlet.run(options.minutes, options.pause)
        home = Path(folder) / "home"
        executed, violations = executions(gauntlet.entrants, watch, trace)
        for entrant in gauntlet.entrants:
            violations += judge(entrant, where, home)
        violations = list(dict.fromkeys(violations))  # two readers may tell the same
        report(gauntlet.entrants, faults, executed, violations)
        if violations and options.evidence:
            keep_evidence(where, home, trace, options.evidence)
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
