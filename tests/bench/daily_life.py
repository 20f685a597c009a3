#!/usr/bin/env python3
"""What people do all day on a cluster that they share, on a real node.

    python tests/bench/daily_life.py [--only logs,assets,events,replacement]

Brings up a real node with RoboVAST installed by its chart. Prints

- how long `vast exec cluster logs` takes for a run that is executed and for one that is stored, and
  how late a line is shown that is followed, beside `kubectl logs` of the same container;
- how long a campaign takes whose runs read 64 MB each from a claim, and from its own `run_files`;
- how many Events a campaign with many failed runs has, and how long `kubectl describe` is;
- how long the operator is replaced for while campaigns of both API versions are executed, and
  whether any run was executed again.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from robovast_testbed import images, programs  # noqa: E402
from support.campaigns.local import make_campaign  # noqa: E402
from support.kube.lab import (  # noqa: E402
    QUICK,
    SYSTEM,
    VAST,
    Lab,
    bench_lab,
    fill_claim,
)
from support.patience import eventually  # noqa: E402

PATIENCE = 900
LINES = 60
"""How many followed lines are looked at."""
REPEAT = 5
WORLD = 64_000_000
"""Size of what each run reads [byte]."""


def timed(act: Callable[[], object]) -> float:
    begin = time.perf_counter()
    act()
    return time.perf_counter() - begin


def spread(values: list[float]) -> str:
    return f"{median(values):.3f} s [{min(values):.3f}–{max(values):.3f}]"


def document(variants: int) -> str:
    """A campaign of so many runs."""
    return QUICK.replace("[1, 2, 3]", json.dumps(list(range(1, variants + 1))))


def logs(lab: Lab) -> None:
    lab.quick("talk", '[ "$1" != 2 ] || for i in $(seq 600); do date +%s.%N; sleep 0.2; done\n')
    where = ("-n", lab.namespace)
    eventually(lambda: lab.campaign("talk").get("status", {}).get("runs", {}).get("stored") == 2)
    pods = lab.get("pods", "--selector=robovast.io/role=shard")["items"]
    (pod,) = [p["metadata"]["name"] for p in pods if p["status"]["phase"] == "Running"]
    of_pod = ("logs", f"pod/{pod}", "--container=robovast")
    asked: dict[str, list[float]] = {"executed": [], "kubectl": [], "stored": []}
    for _ in range(REPEAT):
        for what, run in (("executed", "one-2/0"), ("stored", "one-1/0")):
            words = ("exec", "cluster", "logs", "talk", run, *where)
            asked[what].append(timed(lambda w=words: lab.vast(*w)))  # type: ignore[misc]
        asked["kubectl"].append(timed(lambda: lab.kubectl(*of_pod)))
    print(f"log of a run that is executed: {spread(asked['executed'])}")
    print(f"… by kubectl: {spread(asked['kubectl'])}")
    print(f"… of one that is stored: {spread(asked['stored'])}")
    follow = [VAST, "exec", "cluster", "logs", "--follow", "talk", "one-2/0", *where]
    print(f"a followed line comes late by {spread(late(lab, follow))}")
    kubectl = [programs.kubectl(), "--namespace", lab.namespace, *of_pod, "--follow"]
    print(f"… by kubectl: {spread(late(lab, kubectl))}", flush=True)


def late(lab: Lab, command: list[str | Path]) -> list[float]:
    """By how much lines come later than they were written [s], once all earlier ones are there."""
    env = os.environ | lab.env
    begin = time.time()
    found: list[float] = []
    with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) as follower:
        assert follower.stdout is not None
        for line in follower.stdout:
            written = re.search(r"\b\d{10}\.\d{9}\b", line)
            if written and float(written[0]) > begin + 2:
                found.append(time.time() - float(written[0]))
            if len(found) == LINES:
                break
        follower.terminate()
    return found


def execute(lab: Lab, path: Path, *options: str, code: int = 0) -> float:
    """How long a campaign takes, as its user sees it [s]."""
    words = ("-V", path, "exec", "cluster", "run", "--image", images.SLIM, *options)
    return timed(lambda: lab.vast(*words, code=code))


def assets(lab: Lab, pods: int = 10) -> None:
    make = f"head -c {WORLD} /dev/urandom > world.bin"
    fill_claim(lab, "worlds", make, "100Mi")
    claim = "  kubernetes: {assets: [{path: /assets, claim: worlds}]}\n"
    read = 'sha256sum "%s/world.bin"\n'
    mounted = make_campaign(lab.folder / "claim", read % "/assets", claim, document(pods))
    copied = make_campaign(lab.folder / "copy", read % "/config/files", "", document(pods))
    (copied.parent / "files/world.bin").write_bytes(os.urandom(WORLD))
    where = ("-n", lab.namespace)
    print(f"{pods} pods that read {WORLD / 1e6:.0f} MB each from a claim: ", end="")
    print(f"{execute(lab, mounted, *where):.1f} s, ", end="", flush=True)
    print(f"from run_files: {execute(lab, copied, *where):.1f} s", flush=True)


def events(lab: Lab, runs: int = 600) -> None:
    script = "exit $(($1 % 3 == 0))\n"
    path = make_campaign(lab.folder / "sour", script, "  runs_per_job: 100\n", document(runs))
    lab.apply(path, "sour")
    lab.wait("sour", seconds=PATIENCE)
    counted = lab.campaign("sour")["status"]["runs"]
    told = lab.kubectl("describe", "campaign", "sour").partition("\nEvents:")[2].splitlines()
    print(
        f"{counted['failed']} of {counted['total']} runs failed: {len(told) - 3} Events", flush=True
    )


def replacement(lab: Lab, campaigns: int = 8, runs: int = 10) -> None:
    path = make_campaign(lab.folder / "held", "sleep 4\n", "", document(runs))
    names = [f"held-{index}" for index in range(campaigns)]
    for name in names:
        made = lab.prepared(path, name)
        made["spec"] = {**made["spec"], "parallelism": 1}
        lab.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    eventually(lambda: all(_stored(lab, name) for name in names), PATIENCE)
    rollout = ("--namespace", SYSTEM, "rollout")
    lab.cluster.kubectl(*rollout, "restart", "deployment/robovast-operator")
    begin = time.perf_counter()
    lab.cluster.kubectl(*rollout, "status", "deployment/robovast-operator", "--timeout=180s")
    rolled = time.perf_counter() - begin
    before = {name: _stored(lab, name) for name in names}
    eventually(lambda: all(_stored(lab, n) > before[n] for n in names), PATIENCE)
    said = time.perf_counter() - begin
    for name in names:
        lab.wait(name, seconds=PATIENCE)
    pods = lab.get("pods", "--selector=robovast.io/role=shard")["items"]
    begun = [p for p in pods if p["metadata"]["labels"]["robovast.io/campaign"] in names]
    print(f"operator replaced under {campaigns} campaigns: there after {rolled:.1f} s, ", end="")
    print(f"news of all after {said:.1f} s, {len(begun) - campaigns * runs} runs again", flush=True)


def _stored(lab: Lab, name: str) -> int:
    return int(lab.campaign(name).get("status", {}).get("runs", {}).get("stored", 0))


PARTS = {part.__name__: part for part in (logs, assets, events, replacement)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", default=",".join(PARTS))
    chosen = parser.parse_args().only.split(",")
    with bench_lab("daily") as lab:
        for name in chosen:
            PARTS[name](lab)
            lab.kubectl("delete", "campaigns", "--all")
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} CPUs")


if __name__ == "__main__":
    main()
