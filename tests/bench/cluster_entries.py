#!/usr/bin/env python3
"""What many entries cost: a document of thousands, and Configurations that were applied by hand.

    python tests/bench/cluster_entries.py [--entries 2000] [--added 80]

A control plane with fake nodes. First a document of one run for each entry, packed by 200: time
from the request to the first Job, to all Configurations, and the operator's writes per run. Then
Configurations are applied to a small campaign one after the other, and all at once looked at
again and again: CPU of the operator.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from robovast_testbed import bed, controlplane  # noqa: E402
from robovast_testbed.kubernetes import Cluster  # noqa: E402
from support.kube.operator_process import (  # noqa: E402
    ACCOUNT,
    OperatorProcess,
    campaign,
    finish_stage,
    prepare,
    write_requests,
)
from support.kube.requests import Requests  # noqa: E402
from support.patience import eventually  # noqa: E402

SPACE = "bench"
GROUP = f"/apis/robovast.io/v1beta1/namespaces/{SPACE}"
JOBS = f"/apis/batch/v1/namespaces/{SPACE}/jobs?labelSelector=robovast.io/campaign="
LOOKS = 20


def many_entries(count: int) -> dict[str, Any]:
    """A Campaign of one run for each entry."""
    made = campaign("entries", SPACE, 1, 1)
    entries = [{"name": f"e{number}", "parameters": [{"x": number}]} for number in range(count)]
    made["spec"]["vast"]["configuration"] = entries
    made["spec"]["vast"]["execution"]["runs_per_job"] = 200
    return made


def addition(number: int) -> dict[str, Any]:
    """A Configuration of a thousand variants."""
    values = {"ParameterVariationList": {"name": "x", "values": list(range(1000))}}
    return {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Configuration",
        "metadata": {"name": f"more-{number}", "namespace": SPACE},
        "spec": {"campaign": "added", "variations": [values]},
    }


class Bench:
    """An operator that works, and who asks it."""

    def __init__(self, cluster: Cluster, operator: OperatorProcess) -> None:
        self.cluster = cluster
        self.requests = Requests(cluster, "bench")
        self.operator = operator

    def number(self, path: str) -> int:
        """How many objects there are."""
        return len(self.requests.get(f"{path}&resourceVersion=0")["items"])

    def state(self, name: str) -> dict[str, Any]:
        return dict(self.requests.get(f"{GROUP}/campaigns/{name}").get("status") or {})

    def with_status(self, path: str) -> int:
        """How many objects have one."""
        found = self.requests.get(f"{path}&resourceVersion=0")["items"]
        return sum("status" in item for item in found)

    def measure_entries(self, count: int) -> None:
        """A document of many entries."""
        began = self.cluster.audit_log.stat().st_size
        start = time.monotonic()
        self.requests.post(f"{GROUP}/campaigns", many_entries(count))
        own = f"{GROUP}/configurations?limit={count}"
        moments: dict[str, float] = {}
        waits = {
            "the first Job": lambda: self.number(f"{JOBS}entries"),
            "all Configurations": lambda: self.number(own) == count,
            "the end": lambda: self.state("entries").get("state") == "Finished",
            "all their statuses": lambda: self.with_status(own) == count,
        }
        while len(moments) < len(waits):
            for what, there in waits.items():
                if what not in moments and there():
                    moments[what] = time.monotonic() - start
            time.sleep(0.2)
        counted = write_requests(self.cluster, began, SPACE)
        writes = {key: n for key, n in counted.items() if key.startswith(ACCOUNT)}
        print(f"{count} entries: " + ", ".join(f"{w} after {s:.1f} s" for w, s in moments.items()))
        print(f"{sum(writes.values()) / count:.3f} own writes a run: {writes}")

    def measure_added(self, count: int) -> None:
        """Configurations applied by hand, of 1,000 variants each."""
        self.requests.post(f"{GROUP}/campaigns", campaign("added", SPACE, 1, 1, suspend=True))
        eventually(lambda: self.state("added").get("runs"), 60)
        before = self.operator.usage()[0]
        for number in range(count):
            self.requests.post(f"{GROUP}/configurations", addition(number))
        wanted = 1 + 1000 * count
        eventually(lambda: self.state("added")["runs"]["total"] == wanted, 1200)
        taken = self.operator.usage()[0] - before
        print(f"{count} applied by hand, 1,000 variants each: {taken:.1f} s of CPU")
        before = self.operator.usage()[0]
        for number in range(LOOKS):  # each change of a label is a look
            label = ("label", "--overwrite", "campaign/added", f"look=n{number}")
            self.cluster.kubectl(f"--namespace={SPACE}", *label)
            time.sleep(1)
        taken = (self.operator.usage()[0] - before) / LOOKS
        print(f"a look: {taken:.3f} s of CPU, with what is done beside it in a second")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--entries", type=int, default=2000)
    parser.add_argument("--added", type=int, default=80)
    options = parser.parse_args()
    with bed.session(f"entries-{os.getpid()}") as own, TemporaryDirectory() as folder:
        cluster = controlplane.start(own)
        prepare(cluster, 20, [finish_stage("entries", options.entries)])
        cluster.kubectl("create", "namespace", SPACE)
        operator = OperatorProcess(cluster, Path(folder))
        operator.start()
        try:
            eventually(lambda: "leads" in operator.told(), 60, operator.told)
            bench = Bench(cluster, operator)
            if options.entries:
                bench.measure_entries(options.entries)
            if options.added:
                bench.measure_added(options.added)
        finally:
            operator.stop()


if __name__ == "__main__":
    main()
