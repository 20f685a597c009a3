#!/usr/bin/env python3
"""Time of a campaign that MultiKueue executes in a worker cluster, beside one at home.

    python tests/bench/worker_cluster.py [--repeat 5]

Brings up a manager with RoboVAST, a worker, each with a real node, and an S3 server. Campaigns of
three configurations with two runs each, a pod for each run, one of which fails, are requested in
turns by a queue that leads to the worker and by one of the manager's own, from `kubectl create` to
the complete bucket. On a machine that does other work, both take longer.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from robovast_testbed import images  # noqa: E402
from support.campaigns.local import make_campaign  # noqa: E402
from support.kube.lab import QUICK, Lab  # noqa: E402
from support.kube.worker_node import HERE, WORKER, make_labs, pair  # noqa: E402

PATIENCE = 600


def seconds_to_end(lab: Lab, path: Path, name: str, queue: str) -> float:
    """From the request for a campaign to its complete bucket; the campaign is removed."""
    made = lab.prepared(path, name)
    obj = {**made, "spec": {**made["spec"], "queueName": queue}}
    begin = time.perf_counter()
    lab.kubectl("create", "--filename=-", stdin=json.dumps(obj))
    lab.wait(name, seconds=PATIENCE)
    took = time.perf_counter() - begin
    runs = lab.campaign(name)["status"]["runs"]
    assert (runs["passed"], runs["failed"]) == (5, 1), runs
    lab.kubectl("delete", "campaign", name, f"--timeout={PATIENCE}s")
    return took


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    script = '[ "$1" != 2 ] || [ "$(basename "$3")" = 1 ]\n'
    times: dict[str, list[float]] = {WORKER: [], HERE: []}
    with pair([images.archive()]) as made, TemporaryDirectory() as folder:
        lab = make_labs(made, Path(folder)).manager
        path = make_campaign(lab.folder / "mixed", script, "  runs: 2\n", QUICK)
        for index in range(options.repeat):
            for queue, some in times.items():
                some.append(seconds_to_end(lab, path, f"{queue}-{index}", queue))
                print(f"{queue}: {some[-1]:.1f} s, load {os.getloadavg()[0]:.0f}", flush=True)
    for queue, some in times.items():
        print(f"{queue}: {statistics.median(some):.1f} s [{min(some):.1f}–{max(some):.1f}]")


if __name__ == "__main__":
    main()
