#!/usr/bin/env python3
"""Time from `kubectl apply` to the first run's start, beside a bare Job with the same containers.

    python tests/bench/cluster_start.py [--repeat 5]

Brings up a real node with RoboVAST installed by its chart. Campaign and bare Job alternate; each
has one run. The bare Job has the pod of the campaign's own Job, so it prepares the run, too. A
run has started when it has written to its log.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from robovast_testbed.errors import StartFailed  # noqa: E402
from support.campaigns.local import DOCUMENT, make_campaign  # noqa: E402
from support.kube.lab import SYSTEM, Lab, bench_lab  # noqa: E402


def seconds_to_start(lab: Lab, obj: dict[str, Any], selector: str) -> float:
    """From the request that creates an object to the first line of a run."""
    begin = time.perf_counter()
    lab.kubectl("create", "--filename=-", stdin=json.dumps(obj))
    while True:
        with suppress(StartFailed):  # as long as there is no container
            words = ("logs", f"--selector={selector}", "--container=robovast", "--tail=1")
            if lab.kubectl(*words):
                return time.perf_counter() - begin


def bare_job(lab: Lab, name: str, index: int) -> dict[str, Any]:
    """The Job of a campaign's shard under another name, owned and looked after by nobody."""
    (job,) = lab.get("jobs", f"--selector=robovast.io/role=shard,robovast.io/campaign={name}")[
        "items"
    ]
    spec = {k: v for k, v in job["spec"].items() if k not in {"selector", "template"}}
    pod = job["spec"]["template"]["spec"]
    labels = {"bare": str(index)}
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {"name": f"bare-{index}", "namespace": lab.namespace},
        "spec": {**spec, "template": {"metadata": {"labels": labels}, "spec": pod}},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    with bench_lab("start") as lab:
        path = make_campaign(lab.folder / "one", "true\n", "", DOCUMENT.replace("[1, 2, 3]", "[1]"))
        ours, bare = [], []
        for index in range(options.repeat):
            name = f"ours-{index}"
            obj = lab.prepared(path, name)
            selector = f"robovast.io/role=shard,robovast.io/campaign={name}"
            ours.append(seconds_to_start(lab, obj, selector))
            lab.wait(name)
            bare.append(seconds_to_start(lab, bare_job(lab, name, index), f"bare={index}"))
        mine, other = statistics.median(ours), statistics.median(bare)
        print(
            f"apply to first start: Campaign {mine:.2f} s, bare Job with the same containers "
            f"{other:.2f} s, ratio {mine / other:.2f}; operator in {SYSTEM}"
        )


if __name__ == "__main__":
    main()
