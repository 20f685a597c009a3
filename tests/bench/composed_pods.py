#!/usr/bin/env python3
"""What a pod of a composed campaign costs before its run starts, by the number of variants.

    python tests/bench/composed_pods.py [--variants 100 10000]

Each variant has parameters of 3.3 kB of YAML, as those of the example robot_navigation have. The
compose Job, the agent of the last pack, of one run, until that is prepared, and the finish Job are
executed as processes beside a MinIO of the testbed; prints CPU seconds and largest memory of each.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from robovast_testbed import bed, network, s3  # noqa: E402
from support.campaigns.local import DOCUMENT, make_campaign  # noqa: E402
from support.kube.pod_processes import Campaign, Pod, pids_of  # noqa: E402

from robovast.kubeapi.pod_contract.exit_codes import AgentExit  # noqa: E402

PLUGIN = """\
from robovast.common.variation import Variation

class Paths(Variation):
    def variation(self, in_configs):
        path = [{"x": n / 7, "y": n / 3, "yaw": n / 11, "frame": f"map-{n}"} for n in range(42)]
        return [
            {**config, "name": f"{config['name']}-{x}", "config": {"x": x, "path": path}}
            for config in in_configs for x in range(VARIANTS)
        ]
"""


def memory(pid: int) -> int:
    """The most memory that a process has had so far [KiB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next((int(line.split()[1]) for line in lines if line.startswith("VmHWM")), 0)


def execute(pod: Pod, command: str, *arguments: object, index: int = 0) -> None:
    """Do it, and say what it cost."""
    process = pod.command(command, *arguments, index=index)
    largest, ended, told = 0, 0, False
    while not ended:  # what is reported at the end has what the parent had at its beginning
        with suppress(OSError):
            largest = max([largest, *map(memory, pids_of(pod.work))])
        if not told and pod.script.exists():
            os.kill(process.pid, signal.SIGTERM)
            told = True
        time.sleep(0.02)
        ended, status, used = os.wait4(process.pid, os.WNOHANG)
    process.returncode = os.waitstatus_to_exitcode(status)
    text = f"{used.ru_utime + used.ru_stime:.2f} s CPU, {largest / 1024:.0f} MiB"
    print(f"  {command}: {text}" + (f", exit {process.returncode}" if process.returncode else ""))
    if process.returncode not in (0, AgentExit.RUNS_LEFT):
        print(pod.log(command)[-1000:])


def measure(server: s3.Server, root: Path, variants: int) -> None:
    """One campaign."""
    document = DOCUMENT.replace(
        "ParameterVariationList: {name: x, values: [1, 2, 3]}", "./paths.py:Paths: {}"
    )
    vast = make_campaign(root / "source", "true\n", document=document)
    (vast.parent / "paths.py").write_text(PLUGIN.replace("VARIANTS", str(variants)))
    campaign = Campaign(root / "mounts", vast, server, {"expansion": "composed"})
    print(f"{variants} variants")
    try:
        composing = Pod(campaign)
        execute(composing, "compose")
        digest = composing.message().get("digest")
        plan = campaign.root / "plan/campaign.json"
        known = {**json.loads(plan.read_text()), **({"composed": digest} if digest else {})}
        plan.write_text(json.dumps(known))
        execute(Pod(campaign), "agent", index=variants - 1)
        execute(Pod(campaign), "finish")
        plan.write_text(json.dumps({k: v for k, v in known.items() if k != "composed"}))
        print("  as of a campaign that an older version composed:")
        execute(Pod(campaign), "agent", index=variants - 1)
    finally:
        campaign.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--variants", type=int, nargs="+", default=[100, 10_000])
    arguments = parser.parse_args()
    with bed.session("composed-pods") as own, TemporaryDirectory() as folder:
        network.create_bridge(own)
        server = s3.start(own, "minio")
        for variants in arguments.variants:
            measure(server, Path(folder, str(variants)), variants)


if __name__ == "__main__":
    main()
