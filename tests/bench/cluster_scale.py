#!/usr/bin/env python3
"""What the operator adds: a campaign beside one bare Indexed Job of the same pods, on fake nodes.

    python tests/bench/cluster_scale.py [--runs 1000] [--parallelism 1000] [--nodes 20]

Brings up a control plane of its own, with the controllers' default limits. Prints the time until
all runs have a verdict, write requests to the API server by user and per run (from its audit log),
each beside the bare Job; CPU time and peak memory of the operator; the size of the Campaign object.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from operator_process import (  # noqa: E402
    ACCOUNT,
    OperatorProcess,
    campaign,
    eventually,
    finish_stage,
    prepare,
    status,
    writes,
)
from robovast_testbed import bed, controlplane  # noqa: E402
from robovast_testbed.kubernetes import Cluster  # noqa: E402

SPACE = "bench"
VARIANTS = 50


def bare_job(job: dict[str, Any], runs: int, parallelism: int) -> dict[str, Any]:
    """The Job of a shard, made into one Job of all runs that nobody looks after."""
    spec = {
        key: value
        for key, value in job["spec"].items()
        if key in {"completionMode", "backoffLimitPerIndex", "podFailurePolicy", "template"}
    }
    kept = {k: v for k, v in spec["template"]["metadata"]["labels"].items() if "robovast" in k}
    spec["template"]["metadata"] = {"labels": kept}
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {"name": "bare", "namespace": SPACE},
        "spec": {
            **spec,
            "completions": runs,
            "parallelism": parallelism,
            "maxFailedIndexes": runs,
        },
    }


def wait(cluster: Cluster, kind: str, name: str, path: str, wanted: str) -> float:
    """Seconds until a field has a value."""
    begin = time.perf_counter()
    query = f"--for=jsonpath={{{path}}}={wanted}"
    cluster.kubectl("--namespace", SPACE, "wait", f"{kind}/{name}", query, "--timeout=60m")
    return time.perf_counter() - begin


def told(what: str, counts: dict[str, int], runs: int) -> None:
    total = sum(counts.values())
    print(f"{what}: {total} writes, {total / runs:.2f} per run")
    for user, count in sorted(counts.items(), key=lambda item: -item[1])[:6]:
        print(f"    {count / runs:8.3f} per run  {user}")


def measure(cluster: Cluster, folder: Path, runs: int, parallelism: int) -> None:
    operator = OperatorProcess(cluster, folder)
    operator.start()
    eventually(lambda: "leads" in operator.log.read_text(), 60)
    begin = cluster.audit_log.stat().st_size
    try:
        cluster.apply(campaign("ours", SPACE, VARIANTS, runs // VARIANTS, parallelism=parallelism))
        ours = wait(cluster, "campaign", "ours", ".status.progress", f"{runs}/{runs}")
        own_writes = writes(cluster, begin)
        eventually(lambda: status(cluster, SPACE, "ours")["state"] == "Finished", 60)
        cpu, peak = operator.usage()
        size = len(json.dumps(cluster.get("campaign", "ours", f"--namespace={SPACE}")))
    finally:
        operator.stop()
    jobs: Any = cluster.get("jobs", f"--namespace={SPACE}", "--selector=robovast.io/role=shard")
    template = jobs["items"][0]
    shards = len(jobs["items"])
    cluster.kubectl(
        *("--namespace", SPACE, "delete", "campaign", "ours", "--cascade=foreground"),
        "--timeout=20m",
    )
    begin = cluster.audit_log.stat().st_size
    cluster.apply(bare_job(template, runs, parallelism))
    bare = wait(cluster, "job", "bare", ".status.succeeded", str(runs))
    bare_writes = writes(cluster, begin)
    print(f"makespan: ours {ours:.1f} s, bare Indexed Job {bare:.1f} s, ratio {ours / bare:.2f}")
    told(f"ours ({shards} shards)", dict(own_writes), runs)
    told("bare Indexed Job", dict(bare_writes), runs)
    print(
        f"our operator's own writes: {own_writes[ACCOUNT] / runs:.3f} per run, its Lease included"
    )
    print(
        f"operator: {cpu:.2f} s of CPU ({1000 * cpu / runs:.2f} ms per run), "
        f"peak memory {peak / 2**20:.0f} MiB"
    )
    print(f"Campaign object: {size / 1000:.1f} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--parallelism", type=int, default=1000)
    parser.add_argument("--nodes", type=int, default=20)
    options = parser.parse_args()
    runs = max(VARIANTS, options.runs // VARIANTS * VARIANTS)
    with bed.session(f"scale-{os.getpid()}") as own, TemporaryDirectory() as folder:
        cluster = controlplane.start(own)
        prepare(cluster, options.nodes, [finish_stage("ours", runs)])
        cluster.kubectl("create", "namespace", SPACE)
        measure(cluster, Path(folder), runs, min(options.parallelism, 10_000))


if __name__ == "__main__":
    main()
