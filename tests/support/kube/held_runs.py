"""Runs on a cluster that go on until a test lets them end."""

from __future__ import annotations

from robovast_testbed.errors import StartFailed

from support.kube.lab import Lab
from support.patience import eventually

HELD = "until [ -e /tmp/go ]; do sleep 0.5; done\n"
"""What such a run executes; it writes nothing."""


def release(lab: Lab, campaign: str, most: int | None = None) -> None:
    """Let the runs end that the pods of a campaign execute now, or some of these."""
    shards = f"--selector=robovast.io/campaign={campaign},robovast.io/role=shard"
    running = ("--field-selector=status.phase=Running", "--output=name")
    for pod in lab.kubectl("get", "pods", shards, *running).split()[:most]:
        lab.kubectl("exec", pod, "--container=robovast", "--", "touch", "/tmp/go")


def release_until_finished(lab: Lab, campaign: str) -> None:
    """Let the runs of a campaign end, those of later pods, too."""

    def finished() -> bool:
        try:
            release(lab, campaign)
        except StartFailed:  # a pod begins just now, or has ended
            return False
        return lab.conditions(campaign).get("ResultsAvailable", {}).get("status") == "True"

    eventually(finished, 240, lambda: lab.describe(campaign))
