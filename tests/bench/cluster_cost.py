#!/usr/bin/env python3
"""What a campaign of pods with one run each costs, beside a bare Indexed Job of the same runs.

    python tests/bench/cluster_cost.py [--runs 20] [--repeat 3]

Brings up a real node with RoboVAST installed by its chart. Campaign and bare Job alternate: the
Job's pods have nothing but the run image, which executes the same scenario with the same inputs and
keeps no result. Prints the time from the request to the end, CPU of all containers on the node (of
the campaign also those of the operator and the S3 server) with both ratios, and what each container
of a campaign's pods takes. On a machine that does other work, compare CPU rather than time.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from robovast_testbed import images  # noqa: E402
from support.campaigns.local import DOCUMENT, make_campaign  # noqa: E402
from support.kube.lab import SYSTEM, Lab, bench_lab  # noqa: E402

GROUPS = Path("/sys/fs/cgroup")
PATIENCE = 900
LOOK = 0.1
"""How often containers are looked at [s]; what they take after the last look is not seen."""


class Containers:
    """CPU and memory of all containers of this machine, looked at until they are gone."""

    def __init__(self) -> None:
        self.cpu: dict[str, float] = {}
        self.memory: dict[str, float] = {}
        self._others = {group.name for group in self._groups()}
        self._end = Event()
        self._watcher = Thread(target=self._watch)

    def __enter__(self) -> Containers:
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._watcher.join()

    def _watch(self) -> None:
        while not self._end.wait(LOOK):
            self.look()

    def look(self) -> None:
        """Read the control groups, whose names are the containers' ids."""
        for group in self._groups():
            if group.name not in self._others:
                with suppress(OSError):
                    self.cpu[group.name] = int((group / "cpuacct.usage").read_text()) / 1e9
                    memory = GROUPS / "memory/k8s.io" / group.name / "memory.max_usage_in_bytes"
                    self.memory[group.name] = int(memory.read_text()) / 2**20

    def _groups(self) -> Iterator[Path]:
        return (GROUPS / "cpuacct/k8s.io").glob("[0-9a-f]*")


def bare_job(lab: Lab, path: Path, name: str, runs: int) -> list[dict[str, Any]]:
    """An Indexed Job whose pods execute the scenario of a document, and nothing else."""
    files = {"scenario.osc": "scenario.osc", "step.sh": "files/step.sh"}
    data = {key: (path.parent / place).read_text() for key, place in files.items()}
    data["parameters.yaml"] = "test: {x: 1}\n"
    items = [{"key": key, "path": files.get(key, key)} for key in data]
    command = ["scenario_execution", "-o", "/out", "/config/scenario.osc"]
    container = {
        "name": "robovast",
        "image": images.SLIM,
        "command": [*command, "--scenario-parameter-file", "/config/parameters.yaml"],
        "volumeMounts": [
            {"name": "config", "mountPath": "/config"},
            {"name": "out", "mountPath": "/out"},
        ],
    }
    pod = {
        "restartPolicy": "Never",
        "automountServiceAccountToken": False,
        "containers": [container],
        "volumes": [
            {"name": "config", "configMap": {"name": name, "items": items}},
            {"name": "out", "emptyDir": {}},
        ],
    }
    job = {"completionMode": "Indexed", "completions": runs, "parallelism": runs}
    meta = {"name": name, "namespace": lab.namespace}
    return [
        {"apiVersion": "v1", "kind": "ConfigMap", "metadata": meta, "data": data},
        {
            "apiVersion": "batch/v1",
            "kind": "Job",
            "metadata": meta,
            "spec": {**job, "template": {"metadata": {"labels": {"cost": name}}, "spec": pod}},
        },
    ]


@dataclass
class Cost:
    """Of all executions of one kind."""

    seconds: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)

    def __str__(self) -> str:
        texts = [
            f"{statistics.median(values):.1f} s{what} [{min(values):.1f}–{max(values):.1f}]"
            for values, what in ((self.seconds, ""), (self.cpu, " CPU"))
        ]
        return ", ".join(texts)


class Bench:
    """A namespace in which both are executed in turns."""

    def __init__(self, lab: Lab, seen: Containers, runs: int) -> None:
        self.lab = lab
        self.seen = seen
        self.runs = runs
        values = f"[{', '.join(map(str, range(runs)))}]"
        document = DOCUMENT.replace("[1, 2, 3]", values)
        self.path = make_campaign(lab.folder / "one", "true\n", "", document)
        self.names: dict[str, str] = {}

    def campaign(self, name: str, cost: Cost) -> None:
        obj = self.lab.prepared(self.path, name)
        self._clear()
        with self._measured(cost, name):
            self.lab.kubectl("create", "--filename=-", stdin=json.dumps(obj))
            self.lab.wait(name, seconds=PATIENCE)
        counted = self.lab.campaign(name)["status"]["runs"]
        assert counted["passed"] == self.runs, counted

    def bare(self, name: str, cost: Cost) -> None:
        objects = bare_job(self.lab, self.path, name, self.runs)
        self._clear()
        with self._measured(cost, name):
            for obj in objects:
                self.lab.kubectl("create", "--filename=-", stdin=json.dumps(obj))
            wait = ("wait", f"job/{name}", "--for=condition=Complete", f"--timeout={PATIENCE}s")
            self.lab.kubectl(*wait)

    @contextmanager
    def _measured(self, cost: Cost, name: str) -> Iterator[None]:
        """Time, and CPU of the pods in the namespace and of those that serve all campaigns."""
        system = self._containers(SYSTEM)
        before, begin = self._cpu(system), time.perf_counter()
        yield
        cost.seconds.append(time.perf_counter() - begin)
        own = self._containers(self.lab.namespace)
        cost.cpu.append(self._cpu(own) + self._cpu(system) - before)
        self.names |= {id_: f"{what} of {name}" for id_, what in own.items()}

    def _clear(self) -> None:
        """Remove what was measured before, with its pods."""
        self.lab.kubectl("delete", "campaigns,jobs", "--all", "--wait", "--cascade=foreground")
        self.lab.kubectl("wait", "pods", "--all", "--for=delete", f"--timeout={PATIENCE}s")

    def _cpu(self, ids: dict[str, str]) -> float:
        self.seen.look()
        return sum(self.seen.cpu.get(id_, 0) for id_ in ids)

    def _containers(self, space: str) -> dict[str, str]:
        """Name by id of the containers of all pods in a namespace."""
        text = self.lab.cluster.kubectl(f"--namespace={space}", "get", "pods", "--output=json")
        return {
            status.get("containerID", "").rpartition("/")[2]: status["name"]
            for pod in json.loads(text)["items"]
            for kind in ("initContainerStatuses", "containerStatuses")
            for status in pod["status"].get(kind, ())
        }

    def print_split(self, of: str) -> None:
        """What containers took, by their names."""
        grouped = defaultdict(list)
        for id_, name in self.names.items():
            if of in name and id_ in self.seen.cpu:
                grouped[name.partition(" ")[0]].append(id_)
        for name, ids in grouped.items():
            cpu = statistics.mean(self.seen.cpu[id_] for id_ in ids)
            memory = statistics.median(self.seen.memory[id_] for id_ in ids)
            print(f"  {name}: {cpu:.3f} s CPU, {memory:.0f} MiB, of {len(ids)} looked at")


def measure(bench: Bench, repeat: int) -> None:
    ours, bare = Cost(), Cost()
    bench.campaign("warm", Cost())
    bench.bare("warm-bare", Cost())
    for index in range(repeat):
        bench.campaign(f"ours-{index}", ours)
        bench.bare(f"bare-{index}", bare)
        print(f"{ours.seconds[-1]:.1f} s beside {bare.seconds[-1]:.1f} s", flush=True)
    load = os.getloadavg()[0]
    print(f"{bench.runs} pods of one run; load {load:.1f} on {os.cpu_count()} CPUs")
    print(f"campaign: {ours}")
    bench.print_split("ours")
    print(f"bare Indexed Job: {bare}")
    bench.print_split("bare-")
    for what, mine, other in (("time", ours.seconds, bare.seconds), ("CPU", ours.cpu, bare.cpu)):
        ratios = [a / b for a, b in zip(mine, other, strict=True)]
        ratio = statistics.median(ratios)
        print(f"ratio in {what}: {ratio:.2f} [{min(ratios):.2f}–{max(ratios):.2f}]")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    with bench_lab("cost") as lab, Containers() as seen:
        measure(Bench(lab, seen, options.runs), options.repeat)


if __name__ == "__main__":
    main()
