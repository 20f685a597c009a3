"""The short form of the local gauntlet: faults at random, and every run is right in the end."""

from __future__ import annotations

import subprocess
import sys

from support.campaigns.local import ROOT

PATIENCE = 900
"""A campaign that has begun is brought to its end, on a busy machine too [s]."""


def test_no_run_is_lost_doubled_misjudged_or_mixed() -> None:
    command = [sys.executable, ROOT / "tests" / "bench" / "gauntlet_local.py"]
    ended = subprocess.run(
        [*command, "--minutes", "1", "--seed", "7"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert (
        "0 runs lost, 0 executed again after they were stored, 0 misjudged, 0 mixed" in ended.stdout
    )
