"""Campaigns that Kueue executes in another cluster: real pods, and one bucket for all of them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from robovast_testbed.pytest_plugin import skipped_when_unavailable
from support.campaigns.local import make_campaign, verdicts
from support.campaigns.local import run as run_here
from support.campaigns.one_run import open_store
from support.kube.held_runs import HELD, release
from support.kube.lab import QUICK, SYSTEM, Lab, files
from support.kube.operator_process import created
from support.kube.worker_clusters import reached, until_reached
from support.kube.worker_node import WORKER, Labs, Pair, make_labs, pair
from support.patience import eventually

PLUGIN = """\
from pathlib import Path
from robovast.common.variation import Variation

class Three(Variation):
    def variation(self, in_configs):
        return [self.update_config(c, {"x": n}) for c in in_configs for n in (1, 2, 3)]

def count(results_dir, config_dir):
    found = sorted(Path(results_dir).glob("*/*/said"))
    for path in found:
        path.with_name("counted").write_text(str(len(found)))
    return True, f"{len(found)} runs"
"""
COMPOSED = QUICK.replace(
    "ParameterVariationList: {name: x, values: [1, 2, 3]}", "plugin.py:Three: {}"
)
PROCESSED = "results_processing:\n  postprocessing:\n  - plugin.py:count\n"


@pytest.fixture(scope="module")
def clusters() -> Iterator[Pair]:
    with skipped_when_unavailable(), pair() as made:
        yield made


@pytest.fixture
def labs(clusters: Pair, tmp_path: Path) -> Iterator[Labs]:
    """Namespaces of the test's own."""
    made = make_labs(clusters, tmp_path)
    yield made
    for lab in (made.manager, made.worker):
        lab.cluster.kubectl("delete", "namespace", lab.namespace, "--wait=false")


def content(lab: Lab) -> list[str]:
    """What a namespace has that a campaign could leave behind."""
    kinds = "jobs,pods,workloads,configmaps,secrets,persistentvolumeclaims"
    return lab.kubectl("get", kinds, "--output=name").split()


def begun(lab: Lab) -> int:
    """How many pods execute a run; a probe decides later whether they are `ready`."""
    states = [pod["status"].get("containerStatuses", []) for pod in lab.get("pods")["items"]]
    runs = (state for of_pod in states for state in of_pod if state["name"] == "robovast")
    return sum("running" in state["state"] for state in runs)


def pods_made(lab: Lab) -> int:
    """How many pods there have been in a namespace so far."""
    return created(lab.cluster, lab.namespace, "pods").total()


def stored(clusters: Pair, lab: Lab, name: str) -> list[str]:
    """The runs that the bucket has which the Campaign's status names."""
    bucket = lab.campaign(name)["status"]["bucket"]
    keys = (item.key for item in open_store(clusters.storage).objects(bucket))
    return sorted(key.removesuffix("/run.json") for key in keys if key.endswith("/run.json"))


def test_runs_are_executed_in_the_worker_and_everything_else_in_the_manager(
    clusters: Pair, labs: Labs, tmp_path: Path
) -> None:
    """With a plugin, whose results and verdicts are those of a laptop; one run of six fails."""
    lab, before = labs.manager, content(labs.worker)
    script = 'echo "$1" >"$3/said"; [ "$1" != 2 ] || [ "$(basename "$3")" = 1 ]\n'
    extra = f"  runs: 2\n  runs_per_job: 2\n{PROCESSED}"
    path = make_campaign(tmp_path / "mixed", script, extra, COMPOSED)
    (path.parent / "plugin.py").write_text(PLUGIN)
    lab.apply(path, "mixed", queueName=WORKER, processResults=True)
    lab.wait("mixed")

    runs = lab.campaign("mixed")["status"]["runs"]
    assert (runs["passed"], runs["failed"], runs["errored"], runs["undecided"]) == (5, 1, 0, 0)
    assert lab.conditions("mixed")["Passed"]["status"] == "False"
    made = created(lab.cluster, lab.namespace, "jobs")
    assert {name.split("-")[2] for name in made} == {"compose", "0", "finish", "process"}
    assert pods_made(lab) == len(made) - 1, "none of a run"
    assert pods_made(labs.worker) == 3

    here = run_here(path, tmp_path / "here", jobs=1)
    assert stored(clusters, lab, "mixed") == sorted(verdicts(here))
    home = lab.download("mixed")
    assert lab.verdicts(home) == verdicts(here)
    assert files(here.campaign) <= files(home)
    assert [path.read_text() for path in home.glob("*/*/counted")] == ["6"] * 6

    lab.kubectl("delete", "campaign", "mixed", "--timeout=180s")
    eventually(lambda: content(labs.worker) == before, told=lambda: content(labs.worker))


def test_a_worker_that_is_lost_goes_on_and_each_run_is_stored_once(
    clusters: Pair, labs: Labs
) -> None:
    """Nobody sees what it stores meanwhile, and the operator that finds it again is a new one."""
    lab, worker = labs.manager, labs.worker

    def runs(**counts: int) -> None:
        def told() -> bool:
            now = lab.campaign("lost").get("status", {}).get("runs", {})
            return counts.items() <= now.items()

        eventually(told, told=lambda: lab.describe("lost") + worker.kubectl("get", "pods,jobs"))

    lab.quick("lost", f'echo run >>"$3/log"\n{HELD}', "  runs: 2\n", queueName=WORKER)
    eventually(lambda: begun(worker) == 6, told=lambda: lab.describe("lost"))
    release(worker, "lost", 1)
    runs(active=5, passed=1)
    with clusters.worker.cable.pulled():
        eventually(lambda: not reached(lab.cluster, "south"), told="Kueue misses the worker")
        operator = ("--selector=app=robovast-operator", "--timeout=180s")
        lab.cluster.kubectl("--namespace", SYSTEM, "delete", "pod", *operator)
        release(worker, "lost", 2)
        eventually(lambda: len(stored(clusters, lab, "lost")) == 3, told="runs are stored")
        eventually(
            lambda: lab.conditions("lost")["Stalled"].get("reason") == "WorkerLost",
            told=lambda: lab.describe("lost"),
        )
    until_reached(lab.cluster, "south")
    runs(active=3, passed=3)
    release(worker, "lost")
    lab.wait("lost")

    assert len(stored(clusters, lab, "lost")) == 6
    home = lab.download("lost")
    assert set(lab.verdicts(home).values()) == {"passed"}
    assert [path.read_text() for path in home.glob("*/*/log")] == ["run\n"] * 6
    index = json.loads((home / "_execution/index.json").read_text())
    assert Counter(run["id"] for run in index["runs"]) == dict.fromkeys(range(6), 1)
    assert {run["attempt"] for run in index["runs"]} == {1}
    assert pods_made(worker) == 6
    assert pods_made(lab) == 1, "that of `finish`"
    eventually(
        lambda: not worker.kubectl("get", "jobs,pods,workloads", "--output=name"),
        told="nothing is left in the worker",
    )
