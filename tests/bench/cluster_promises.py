#!/usr/bin/env python3
"""How long a small Campaign waits beside heavy ones, and a finished run for a slow link.

    python tests/bench/cluster_promises.py [--repeat 5]

On a real node, with RoboVAST installed by its chart. First, five `.vast` files of 97,336 variants
with 60 parameters each are applied in one namespace, and small Campaigns in another: prints the
time until each is accepted. Then runs log 240 kB/s while the link to the S3 server has 3 Mbit/s, so
each run ends while a part of its log is being sent: prints the time from its end until it is
stored.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from statistics import median

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from support.kube.lab import SYSTEM, Lab, bench_lab  # noqa: E402
from support.kube.operator_process import campaign, heavy  # noqa: E402
from support.kube.requests import Requests  # noqa: E402
from support.patience import eventually  # noqa: E402

GROUP = "/apis/robovast.io/v1beta1/namespaces"
HEAVY = 5
SMALL = 5
"""Campaigns that are applied one after the other beside the heavy ones, in each repetition."""
LOGGING = """\
for second in $(seq 40); do head -c 180000 /dev/urandom | base64; sleep 1; done
head -c 100000 /dev/urandom > "$3/out.bin"
"""
RATE = "3mbit"


def accepted(requests: Requests, namespace: str, name: str) -> bool:
    found = requests.get(f"{GROUP}/{namespace}/campaigns/{name}")
    conditions = found.get("status", {}).get("conditions", [])
    return any((c["type"], c["status"]) == ("Accepted", "True") for c in conditions)


def measure_acceptance(lab: Lab, repeat: int) -> Iterator[tuple[float, int]]:
    """Seconds of each small Campaign, and how many heavy ones were not accepted then."""
    requests = Requests(lab.cluster, "bench")
    for turn in range(repeat):
        others = f"heavy-{turn}"
        lab.cluster.kubectl("create", "namespace", others)
        names = [f"huge-{number}" for number in range(HEAVY)]
        for name in names:
            requests.post(f"{GROUP}/{others}/campaigns", heavy(name, others, 46, 60))
        for number in range(SMALL):
            name = f"small-{turn}-{number}"
            small = campaign(name, lab.namespace, 3, 1, suspend=True)
            begun = time.monotonic()
            requests.post(f"{GROUP}/{lab.namespace}/campaigns", small)
            eventually(lambda name=name: accepted(requests, lab.namespace, name))
            took = time.monotonic() - begun
            waiting = sum(not accepted(requests, others, name) for name in names)
            yield took, waiting
        lab.cluster.kubectl("delete", "namespace", others, "--timeout=300s")
    lab.kubectl("delete", "campaigns", "--all", "--timeout=300s")


@contextmanager
def slow_link(lab: Lab) -> Iterator[None]:
    """All that is sent to the S3 server shares a link of limited rate."""
    pod = lab.cluster.get("pod", "robovast-s3-0", f"--namespace={SYSTEM}")
    inside = lab.cluster.bed.inside

    def run(*command: str) -> str:
        return subprocess.run(
            [*inside, *command], check=True, capture_output=True, text=True
        ).stdout

    near = run("ip", "neigh", "show", pod["status"]["podIP"])
    mac = re.search(r"lladdr (\S+)", near)
    assert mac, near
    fdb = next(line for line in run("bridge", "fdb", "show").splitlines() if mac[1] in line)
    device = fdb.split()[2]
    run(*f"tc qdisc add dev {device} root tbf rate {RATE} burst 16kb latency 400ms".split())
    try:
        yield
    finally:
        run(*f"tc qdisc del dev {device} root".split())


def measure_storing(lab: Lab, repeat: int) -> Iterator[float]:
    """Seconds from the end of each run until its record is in the bucket."""
    for turn in range(repeat):
        name = f"logging-{turn}"
        with slow_link(lab):
            lab.quick(name, LOGGING, parallelism=1)
            lab.wait(name, "Succeeded", 600)
        bucket = lab.campaign(name)["status"]["bucket"]
        find = f"/data/buckets/{bucket} -name run.json -printf '%T@ %p\\n'"
        listed = ("exec", "robovast-s3-0", "--", "sh", "-c", f"find {find}")
        for line in lab.cluster.kubectl("--namespace", SYSTEM, *listed).splitlines():
            at, path = line.split()
            read = ("exec", "robovast-s3-0", "--", "cat", path)
            record = json.loads(lab.cluster.kubectl("--namespace", SYSTEM, *read))
            yield float(at) - datetime.fromisoformat(record["finished_at"]).timestamp()


def show(what: str, took: list[float], loads: list[float]) -> None:
    print(
        f"{what}: {len(took)} times, median {median(took):.2f} s, at most {max(took):.2f} s; "
        f"load {min(loads):.1f} to {max(loads):.1f}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    with bench_lab("promises") as lab:
        took, loads = [], []
        for seconds, waiting in measure_acceptance(lab, options.repeat):
            took.append(seconds)
            loads.append(os.getloadavg()[0])
            print(
                f"accepted after {seconds:.2f} s, {waiting} heavy ones wait, load {loads[-1]:.1f}"
            )
        show("a small Campaign is accepted", took, loads)
        took, loads = [], []
        for seconds in measure_storing(lab, options.repeat):
            took.append(seconds)
            loads.append(os.getloadavg()[0])
            print(f"stored after {seconds:.2f} s, load {loads[-1]:.1f}", flush=True)
        show("a run is stored", took, loads)


if __name__ == "__main__":
    main()
