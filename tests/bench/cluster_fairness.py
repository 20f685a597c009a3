#!/usr/bin/env python3
"""What many small campaigns wait for a large one, and what they cost the operator, on fake nodes.

    python tests/bench/cluster_fairness.py [--campaigns 500] [--namespaces 25] [--large 100000]

Without a queue, with controllers that may make 500 requests a second. Small campaigns of ten runs
in several namespaces are asked for at once: first alone, then while a large one is executed in one
of these namespaces; each time on a control plane of its own. Prints how long they took, from the
creation to the last verdict, and what the operator took.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from robovast_testbed import bed, controlplane, kwok  # noqa: E402
from support.kube.operator_process import (  # noqa: E402
    OperatorProcess,
    campaign,
    finish_stage,
    free_port,
    page,
    prepare,
)
from support.kube.requests import Requests  # noqa: E402
from support.patience import eventually  # noqa: E402

NODES = 20
RUNS = 10
"""Of a small campaign."""
LIMIT = 500
"""Requests that the controller manager may make in a second."""
IDLE = 20.0
"""How long finished campaigns are watched [s]."""
GROUP = "/apis/robovast.io/v1beta1"


@dataclass
class Found:
    """What one measurement came to."""

    took: list[float]
    """How long each small campaign took [s]."""
    memory: int
    """Peak of the operator [byte]."""
    cpu: float
    """Of the operator until all small campaigns had ended [s]."""
    reconciles: dict[float, float]
    """Part of the reconciles that took no longer than so many seconds."""
    left: int
    """What the operator's memory grew by, from before the first campaign until all ended [byte]."""
    idle: float | None
    """CPU of the operator while nothing happens [%]; None while another is executed."""


class Bench:
    """A control plane with an operator."""

    def __init__(self, requests: Requests, operator: OperatorProcess, port: int) -> None:
        self._requests = requests
        self._operator = operator
        self._port = port

    def make(self, space: str, name: str, variants: int, runs: int) -> None:
        toleration = {"key": kwok.TAINT["key"], "operator": "Exists"}
        scheduling = {"nodeSelector": {"type": "kwok"}, "tolerations": [toleration]}
        made = campaign(name, space, variants, runs, scheduling=scheduling)
        self._requests.post(f"{GROUP}/namespaces/{space}/campaigns", made)

    def measure(self, spaces: list[str], number: int, large: int) -> Found:
        before = self._operator.memory()
        if large:
            self.make(spaces[0], "large", large // 20, 20)
            eventually(lambda: self._decided(spaces[0], "large") > 0, 300)
        cpu, _ = self._operator.usage()
        for index in range(number):
            self.make(spaces[index % len(spaces)], f"small-{index // len(spaces)}", RUNS, 1)
        eventually(lambda: self._ended() == number, 1800, self._operator.told)
        used, peak = self._operator.usage()
        idle = None if large else self._idle()
        return Found(
            took=self._took(),
            memory=peak,
            cpu=used - cpu,
            reconciles=_quantiles(page(self._port, "metrics")),
            left=self._operator.memory() - before,
            idle=idle,
        )

    def _decided(self, space: str, name: str) -> int:
        found = self._requests.get(f"{GROUP}/namespaces/{space}/campaigns/{name}")
        return int(found.get("status", {}).get("runs", {}).get("passed", 0))

    def _small(self) -> list[Any]:
        items = self._requests.get(f"{GROUP}/campaigns")["items"]
        return [item for item in items if item["metadata"]["name"] != "large"]

    def _ended(self) -> int:
        return sum(item.get("status", {}).get("state") == "Finished" for item in self._small())

    def _took(self) -> list[float]:
        return sorted(
            _seconds(item["metadata"]["creationTimestamp"], item["status"]["completionTime"])
            for item in self._small()
        )

    def _idle(self) -> float:
        time.sleep(10)  # what is written at the very end has been written then
        before, _ = self._operator.usage()
        time.sleep(IDLE)
        return 100 * (self._operator.usage()[0] - before) / IDLE


def _seconds(begin: str, end: str) -> float:
    return (datetime.fromisoformat(end) - datetime.fromisoformat(begin)).total_seconds()


def _quantiles(metrics: str) -> dict[float, float]:
    bucket = r'robovast_reconcile_seconds_bucket\{le="([0-9.]+)"\} ([0-9.]+)'
    counts = {float(bound): float(count) for bound, count in re.findall(bucket, metrics)}
    (total,) = re.findall(r"robovast_reconcile_seconds_count ([0-9.]+)", metrics)
    return {bound: count / float(total) for bound, count in counts.items()}


@contextmanager
def started(campaigns: int, large: int) -> Iterator[tuple[Bench, list[str]]]:
    """A control plane of its own."""
    with bed.session(f"fairness-{os.getpid()}") as own, TemporaryDirectory() as folder:
        cluster = controlplane.start(own, LIMIT)
        spaces = [f"team-{index}" for index in range(campaigns)]
        stages = [finish_stage(f"small-{index}", RUNS) for index in range(40)]
        prepare(cluster, NODES, [*stages, finish_stage("large", large)])
        for space in spaces:
            cluster.kubectl("create", "namespace", space)
        port = free_port()
        operator = OperatorProcess(cluster, Path(folder), ROBOVAST_PORT=str(port))
        operator.start()
        try:
            eventually(lambda: "leads" in operator.told(), told=operator.told)
            yield Bench(Requests(cluster, "bench"), operator, port), spaces
        finally:
            operator.stop()


def show(name: str, found: Found) -> None:
    took, within = found.took, {b: p for b, p in found.reconciles.items() if p < 1}
    half, most = (
        next((b for b, part in found.reconciles.items() if part >= share), max(within, default=0))
        for share in (0.5, 0.99)
    )
    idle = "" if found.idle is None else f", {found.idle:.1f} % of a CPU when all have ended"
    slow = took[len(took) * 99 // 100]
    print(
        f"{name}: {len(took)} campaigns took {median(took):.0f} s "
        f"[{took[0]:.0f} to {took[-1]:.0f}], 99 of 100 at most {slow:.0f} s; "
        f"operator {found.memory / 2**20:.0f} MiB at most, {found.cpu:.1f} s CPU, reconciles "
        f"≤ {half:g} s (half), ≤ {most:g} s (99 %); {found.left / 2**20:.0f} MiB more than before"
        f"{idle}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--campaigns", type=int, default=500)
    parser.add_argument("--namespaces", type=int, default=25)
    parser.add_argument("--large", type=int, default=100_000, help="runs of the large campaign")
    options = parser.parse_args()
    assert options.campaigns <= 40 * options.namespaces, "a name for each is prepared"
    found = {}
    for name, large in (("alone", 0), ("beside a large one", options.large)):
        with started(options.namespaces, large) as (bench, spaces):
            found[name] = bench.measure(spaces, options.campaigns, large)
        show(name, found[name])
    alone, beside = (median(one.took) for one in found.values())
    print(f"beside it they take {beside / alone:.2f} times as long; load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
