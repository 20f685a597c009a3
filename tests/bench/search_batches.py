"""Measures on a real node how long a search in the cluster waits between two batches.

    python tests/bench/search_batches.py [--batches 8]

Batches of two runs of 5 s. `one by one`: a strategy that is told of each batch before it is asked
for the next one; nothing is executed from the end of a batch's last run to the start of the next
batch's first one. `asked ahead`: `random`, of which three batches are under way.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
from datetime import datetime
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / part) for part in (".", "testbed")]

from support.campaigns.local import make_campaign  # noqa: E402
from support.campaigns.searched import DOCUMENT, at_random  # noqa: E402
from support.kube.lab import Lab, bench_lab  # noqa: E402

PATIENT = """\
from robovast.search.strategies.random_sampling import RandomStrategy


class Patient(RandomStrategy):
    asks_ahead = False
"""
LIMITS = "  seed: 3\n  resources: {cpu: 0.1, memory: 256Mi}\nsearch:"
Times = tuple[float, float]
"""Start and end of a run [s]."""


def executed(lab: Lab, name: str, batches: int, strategy: str) -> list[Times]:
    """Execute a search; returns the times of its runs."""
    extra = at_random(batches).replace("strategy: random", f"strategy: {strategy}")
    text = DOCUMENT.replace("search:", LIMITS)
    path = make_campaign(lab.folder / name, "sleep 5\n", extra, document=text)
    (path.parent / "patient.py").write_text(PATIENT)
    lab.apply(path, name)
    lab.wait(name, seconds=120 * batches)
    records = [json.loads(p.read_text()) for p in lab.download(name).glob("c*/*/run.json")]
    keys = ("started_at", "finished_at")
    return sorted(
        (begun, ended)
        for begun, ended in (
            tuple(datetime.fromisoformat(record[key]).timestamp() for key in keys)
            for record in records
        )
    )


def idle(times: list[Times]) -> list[float]:
    """The stretches of time in which no run was executed [s]."""
    waits, until = [], times[0][1]
    for begun, ended in times[1:]:
        if begun > until:
            waits.append(begun - until)
        until = max(until, ended)
    return waits


def main(batches: int) -> None:
    """Execute both searches and print how long nothing was executed."""
    with bench_lab("batches") as lab:
        for name, strategy in (("one by one", "patient.py:Patient"), ("asked ahead", "random")):
            times = executed(lab, name.replace(" ", "-"), batches, strategy)
            waits, took = idle(times), max(ended for _, ended in times) - times[0][0]
            middle = f"median {statistics.median(waits):.1f} s, " if waits else ""
            least = f"{min(waits):.1f} to {max(waits):.1f} s" if waits else "none"
            print(
                f"{name}: {len(times)} runs in {took:.0f} s; {len(waits)} waits, {middle}{least}, "
                f"{sum(waits) / took:.0%} of the time; load {os.getloadavg()[0]:.0f}",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--batches", type=int, default=8)
    main(parser.parse_args().batches)
