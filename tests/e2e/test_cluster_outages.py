"""A bad day of a cluster: every run is executed once, and none is lost."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from robovast_testbed import outages
from support.kube.lab import SYSTEM, Lab
from support.kube.operator_process import created
from support.patience import eventually

RUNS = 30
S3 = ("--namespace", SYSTEM, "scale", "statefulset/robovast-s3")


def stored(lab: Lab) -> int:
    """How many runs have a verdict."""
    progress = lab.campaign("unlucky").get("status", {}).get("progress", "0/0")
    return int(progress.partition("/")[0])


@contextmanager
def repaired(lab: Lab) -> Iterator[None]:
    """Whatever happens, later tests find a storage, and a node that takes pods."""
    nodes = lab.cluster.kubectl("get", "nodes", "--output=name").split()
    try:
        yield
    finally:
        lab.cluster.kubectl(*S3, "--replicas=1")
        lab.cluster.kubectl("uncordon", *nodes)


def fail_in_turn(lab: Lab) -> None:
    begin = time.monotonic()
    lab.cluster.kubectl(*S3, "--replicas=0")
    with outages.paused(lab.cluster, "etcd"):
        time.sleep(5)
    outages.restart(lab.cluster, "kube-apiserver", 3)
    time.sleep(max(0.0, 60 - (time.monotonic() - begin)))
    before = stored(lab)
    lab.cluster.kubectl(*S3, "--replicas=1")
    eventually(lambda: stored(lab) > before, 240, lambda: lab.describe("unlucky"))
    (node,) = lab.cluster.kubectl("get", "nodes", "--output=name").split()
    lab.cluster.kubectl(
        *("drain", node, "--ignore-daemonsets", "--delete-emptydir-data", "--force"),
        "--timeout=180s",
    )
    assert lab.campaign("unlucky")["status"]["state"] == "Running"


def test_storage_server_store_and_node_fail_in_turn_and_no_run_is_lost(lab: Lab) -> None:
    """S3 away for a minute; etcd hangs and the API server is killed meanwhile; then a drain."""
    lab.quick("unlucky", "sleep 2\n", "  runs: 10\n  runs_per_job: 2\n", parallelism=4)
    eventually(lambda: stored(lab) > 1, 240, lambda: lab.describe("unlucky"))
    with repaired(lab):
        fail_in_turn(lab)
    lab.wait("unlucky", seconds=300)
    runs = lab.campaign("unlucky")["status"]["runs"]
    assert (runs["total"], runs["passed"], runs["errored"]) == (RUNS, RUNS, 0)
    home = lab.download("unlucky")
    assert set(lab.verdicts(home).values()) == {"passed"}
    index = json.loads((home / "_execution/index.json").read_text())
    assert Counter(run["id"] for run in index["runs"]) == dict.fromkeys(range(RUNS), 1)
    assert {run["attempt"] for run in index["runs"]} == {1}
    assert set(created(lab.cluster, lab.namespace, "jobs").values()) == {1}
    logs = "".join(p.read_text(errors="replace") for p in home.glob("_jobs/*/logs/system.log"))
    assert logs.count("Executing scenario") <= RUNS + 4, "the drain ended four at most"
