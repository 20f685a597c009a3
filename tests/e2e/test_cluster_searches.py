"""Searches on a real cluster: whatever dies, and what people do meanwhile."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.campaigns.local import make_campaign
from support.campaigns.searched import DOCUMENT, FAILS_ABOVE_50, at_random, proposed_values
from support.kube.lab import Lab, own_operator
from support.patience import eventually

STEPS = """\
import os
import time

from robovast.search.strategy import HistoryStrategy
from robovast.search.types import ParamSet


class Steps(HistoryStrategy):
    \"\"\"Each batch follows from all evaluations; it takes so long that its pod can be met.\"\"\"

    def propose(self, n):
        time.sleep(6 if "-propose-" in os.environ.get("HOSTNAME", "") else 0)
        begin = len(self.asked)
        begin += sum(known.n_samples * known.params.values["x"] for known in self.known.values())
        return [ParamSet({"x": (begin + 7 * i) % 101}) for i in range(n)]
"""
LIMITED = DOCUMENT.replace("search:", "  seed: 3\n  resources: {cpu: 0.1, memory: 256Mi}\nsearch:")
MEASURED = {
    "optuna": "",
    "qd": (
        "  extract: {metrics: {place: {table: out, column: y, over_time: last}}}\n"
        "  strategy_parameters: {archive: {measures: {place: {low: 0, high: 100, bins: 8}}}}\n"
    ),
}
KILLS = 5
"""Of the operator, and as many of propose pods."""


def document(folder: Path, batches: int) -> Path:
    """A search whose sets follow from what was evaluated."""
    extra = at_random(batches).replace("strategy: random", "strategy: steps.py:Steps")
    path = make_campaign(folder, FAILS_ABOVE_50, extra, document=LIMITED)
    (folder / "steps.py").write_text(STEPS)
    return path


def undisturbed(lab: Lab, path: Path) -> list[list[dict[str, Any]]]:
    """The sets of the same search on this machine."""
    lab.vast("-V", path, "exec", "local", "run", "--runtime", "process", lab.folder / "here")
    (found,) = (lab.folder / "here").glob("test-search-*")
    return proposed_values(found)


def proposing(lab: Lab, plan: int) -> Iterator[str]:
    """Pods that propose after so many plans and were not asked to end."""
    for pod in lab.get("pods", "--selector=robovast.io/role=propose")["items"]:
        metadata = pod["metadata"]
        runs = pod["status"]["phase"] == "Running" and "deletionTimestamp" not in metadata
        if runs and f"-propose-{plan}-" in metadata["name"]:
            yield metadata["name"]


def kill(lab: Lab, plan: int) -> None:
    """Kill the pod that proposes after so many plans, at once."""
    name = eventually(lambda: next(proposing(lab, plan), ""), told=lambda: lab.describe("hunted"))
    lab.kubectl("delete", "pod", name, "--grace-period=0", "--force")


def test_a_search_of_which_operator_and_propose_pod_are_killed_goes_the_same_way(
    lab: Lab,
) -> None:
    path = document(lab.folder / "search", KILLS + 1)
    wanted = undisturbed(lab, path)
    assert len(wanted) == KILLS + 1
    with own_operator(lab) as restart:
        lab.apply(path, "hunted")
        for plan in range(KILLS):
            kill(lab, plan)
            restart()
        lab.wait("hunted", seconds=400)
    status = lab.campaign("hunted")["status"]
    assert (status["search"]["batch"], status["search"]["stop"]) == (KILLS + 1, "batches")
    home = lab.download("hunted")
    assert proposed_values(home) == wanted
    assert len(lab.verdicts(home)) == 2 * (KILLS + 1)


def test_a_search_is_followed_brought_home_stopped_and_resumed_in_the_middle(lab: Lab) -> None:
    path = document(lab.folder / "search", 4)
    wanted = undisturbed(lab, path)
    lab.apply(path, "middle")
    inside = ("-n", lab.namespace)
    eventually(lambda: batch(lab) >= 1, told=lambda: lab.describe("middle"))
    seen = lab.vast("exec", "cluster", "monitor", "--once", *inside).stdout
    assert "failure_rate" in seen
    assert "batches" in seen
    lab.vast("exec", "cluster", "stop", "-i", "middle", *inside)
    stopped = "--for=jsonpath={.status.state}=Suspended"
    lab.kubectl("wait", "campaign/middle", stopped, "--timeout=180s")
    home = lab.download("middle")
    known = proposed_values(home)
    assert 1 <= len(known) <= 4
    assert known == wanted[: len(known)]
    rows = json.loads(lab.vast("results", "search", home, "--output", "json").stdout)
    assert len(rows) >= 2
    lab.vast("exec", "cluster", "resume", "-i", "middle", *inside)
    lab.wait("middle")
    assert proposed_values(lab.download("middle")) == wanted


@pytest.mark.parametrize("kind", ["optuna", "qd"])
def test_whatever_kind_of_search_asks_for_the_same_sets_as_on_this_machine(
    lab: Lab, kind: str
) -> None:
    extra = at_random(2).replace("strategy: random\n", f"strategy: {kind}\n{MEASURED[kind]}")
    path = make_campaign(lab.folder / kind, FAILS_ABOVE_50, extra, document=LIMITED)
    wanted = undisturbed(lab, path)
    lab.apply(path, kind)
    lab.wait(kind)
    assert proposed_values(lab.download(kind)) == wanted
    assert len(wanted) == 2


def batch(lab: Lab) -> int:
    """How many batches are scored."""
    search = lab.campaign("middle").get("status", {}).get("search") or {}
    return int(search.get("batch", 0))
