#!/usr/bin/env python3
"""What share of a campaign's pods' time their starts take, with measured packs on a real node.

    python tests/bench/cluster_packs.py [--runs 400] [--seconds 10] [--pods 8]

Brings up a real node with RoboVAST installed by its chart, and executes a campaign with
`runs_per_job: auto` whose runs wait for so many seconds. A pod's time is that from its arrival on
the node until its last container has ended; its start is what its runs did not take of it. The goal
is that starts take 5 % of all pods' time. Beside it stands what they would take if each run had a
pod, which starts like those here; and how long the campaign took, beside its runs evenly divided.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from statistics import median
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from support.campaigns.local import DOCUMENT, make_campaign  # noqa: E402
from support.kube.lab import Lab, bench_lab  # noqa: E402

PATIENCE = 3000
LOOK = 1.0
"""How often pods are looked at [s]; the last of them stay until the campaign is removed."""


@dataclass(frozen=True)
class Pod:
    """One that executed runs."""

    runs: int
    seconds: float
    """From its arrival on the node until its last container has ended."""
    run_seconds: float
    """Of its runs."""

    @property
    def start(self) -> float:
        return self.seconds - self.run_seconds


def execute(lab: Lab, runs: int, seconds: float, pods: int) -> tuple[float, list[Pod]]:
    """How long a campaign took, and its pods."""
    document = DOCUMENT.replace("[1, 2, 3]", json.dumps(list(range(runs))))
    path = make_campaign(
        lab.folder / "packs", f"sleep {seconds:g}\n", "  runs_per_job: auto\n", document
    )
    begin = time.monotonic()
    lab.apply(path, "packs", parallelism=pods)
    times: dict[str, float] = {}
    while lab.campaign("packs").get("status", {}).get("state") != "Finished":
        assert time.monotonic() < begin + PATIENCE, lab.describe("packs")
        times |= _ended(lab)
        time.sleep(LOOK)
    took = time.monotonic() - begin
    return took, list(_pods(lab, times))


def _ended(lab: Lab) -> dict[str, float]:
    """How long ended pods took [s], by name."""
    found = lab.get("pods", "--selector=robovast.io/role=shard")["items"]
    return {
        pod["metadata"]["name"]: _seconds(pod["status"])
        for pod in found
        if pod["status"]["phase"] == "Succeeded"
    }


def _seconds(status: Mapping[str, Any]) -> float:
    ends = [one["state"]["terminated"]["finishedAt"] for one in status["containerStatuses"]]
    return (max(map(_moment, ends)) - _moment(status["startTime"])).total_seconds()


def _moment(text: str) -> datetime:
    return datetime.fromisoformat(text)


def _pods(lab: Lab, times: Mapping[str, float]) -> Iterator[Pod]:
    home = lab.download("packs")
    records = [json.loads(path.read_text()) for path in home.glob("*/*/run.json")]
    assert {record["verdict"] for record in records} == {"passed"}
    runs = Counter(record["pod"] for record in records)
    assert set(runs) == set(times), "a pod was not looked at"
    for name, count in runs.items():
        of = sum(record["duration"] for record in records if record["pod"] == name)
        yield Pod(count, times[name], of)


def show(took: float, pods: list[Pod], side_by_side: int) -> None:
    all_time, run_time = (sum(getattr(p, x) for p in pods) for x in ("seconds", "run_seconds"))
    runs = sum(pod.runs for pod in pods)
    start, run = median(pod.start for pod in pods), run_time / runs
    sizes = ", ".join(f"{n} × {size}" for size, n in sorted(Counter(p.runs for p in pods).items()))
    print(f"{runs} runs of {run:.1f} s, {side_by_side} pods side by side, a start of {start:.1f} s")
    print(f"packs: {sizes}")
    print(f"starts take {1 - run_time / all_time:.1%} of the pods' time (goal: 5 %)")
    print(f"… with a pod for each run {start / (start + run):.1%}")
    even = run_time / side_by_side
    print(f"the campaign took {took:.0f} s, {took / even:.2f} times its runs evenly divided")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--pods", type=int, default=8)
    options = parser.parse_args()
    with bench_lab("packs") as lab:
        took, pods = execute(lab, options.runs, options.seconds, options.pods)
        show(took, pods, options.pods)


if __name__ == "__main__":
    main()
