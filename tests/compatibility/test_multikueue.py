"""Campaigns that a real Kueue executes in other clusters: three control planes with fake nodes.

Pods of runs end when the test says so, and as it says.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
import yaml
from robovast_testbed.kubernetes import Cluster
from robovast_testbed.pytest_plugin import skipped_when_unavailable
from support.kube.carried_files import inputs_of, plan_of, shown
from support.kube.operator_process import (
    FINISH_STAGE,
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    created,
    finish_stage,
    finished,
    status,
)
from support.kube.worker_clusters import (
    EXIT_CODE,
    Fleet,
    documented,
    fleet,
    local_queue,
    look_at,
    queue,
    until_reached,
)
from support.patience import eventually

MIXED = {"total": 6, "passed": 5, "failed": 1, "errored": 0}
SHARD = "robovast.io/role=shard"
INDEX = "batch.kubernetes.io/job-completion-index"
SOUTH, BOTH = "workers", "both"
"""Queues that lead to the worker `south`, and to this or `north`."""


def leading_to_both() -> list[Any]:
    """The same for the worker `north`, and for what leads to both."""
    cluster, config, check = documented()
    cluster["metadata"]["name"] = cluster["spec"]["kubeConfig"]["location"] = "north"
    config["metadata"]["name"] = check["metadata"]["name"] = BOTH
    config["spec"]["clusters"].append("north")
    check["spec"]["parameters"]["name"] = BOTH
    return [cluster, config, check]


@pytest.fixture(scope="module")
def clusters() -> Iterator[Fleet]:
    """A manager with its workers, and the queues that lead there."""
    mixed = FINISH_STAGE.format(campaign="mixed", message=json.dumps(MIXED))
    stages = [finish_stage("few", 6), finish_stage("late", 6), mixed]
    with skipped_when_unavailable(), fleet(["south", "north"], stages) as made:
        made.manager.apply(*documented(), *leading_to_both())
        for name in (SOUTH, BOTH):
            made.manager.apply(*queue(name, name))
        yield made


@pytest.fixture(scope="module")
def fake_cluster(clusters: Fleet) -> Cluster:
    """The operator's cluster."""
    return clusters.manager


@pytest.fixture
def namespace(clusters: Fleet) -> Iterator[str]:
    """A namespace of the test's own in all clusters, with its queues."""
    name = f"lab-{uuid4().hex[:6]}"
    for cluster in clusters.clusters:
        cluster.kubectl("create", "namespace", name)
        leads = dict.fromkeys((SOUTH, BOTH), "own")
        leads = {q: q for q in leads} if cluster is clusters.manager else leads
        cluster.apply(*(local_queue(q, name, to) for q, to in leads.items()))
    yield name
    for cluster in clusters.clusters:
        cluster.kubectl("delete", "namespace", name, "--wait=false")


@dataclass
class Lab:
    """A namespace in all clusters, and the operator that works in the manager's."""

    clusters: Fleet
    namespace: str
    operator: OperatorProcess

    def kubectl(self, where: str, *arguments: str) -> str:
        return self.cluster(where).kubectl("--namespace", self.namespace, *arguments)

    def cluster(self, where: str) -> Cluster:
        """The manager's cluster, or that of a worker."""
        return self.clusters.manager if where == "manager" else self.clusters.workers[where].cluster

    def start(self, name: str, queue: str) -> None:
        """Create a Campaign of six runs, a pod for each."""
        self.clusters.manager.apply(campaign(name, self.namespace, 3, 2, queueName=queue))

    def change(self, where: str, kind: str, name: str, spec: dict[str, Any]) -> None:
        patch = json.dumps({"spec": spec})
        self.kubectl(where, "patch", kind, name, "--type=merge", f"--patch={patch}")

    def status(self, name: str) -> dict[str, Any]:
        return status(self.clusters.manager, self.namespace, name)

    def runs(self, name: str) -> tuple[int, ...]:
        """How many runs are executed, have passed, have failed."""
        told = self.status(name).get("runs", {})
        return tuple(told.get(key, 0) for key in ("active", "passed", "failed"))

    def stalled(self, name: str) -> str:
        """Why a Campaign makes no progress; empty if it does."""
        found = condition(self.status(name), "Stalled")
        return found["reason"] if found.get("status") == "True" else ""

    def finished(self, name: str) -> bool:
        return finished(self.clusters.manager, self.namespace, name)

    def until(self, condition: Callable[[], Any]) -> Any:
        """What a condition gives as soon as it holds, however busy the machine is."""
        return eventually(condition, told=lambda: f"{self.operator.told()}\n{self.picture()}")

    def picture(self) -> str:
        """All that a person would look at."""
        looks = [self.kubectl("manager", "get", "campaigns", "--output=wide")]
        for name in ("manager", *self.clusters.workers):
            looks += [name, self.kubectl(name, "get", "workloads,jobs,pods", "--output=wide")]
        return "\n".join(looks)

    def job(self) -> Any:
        """The Job of runs in the manager, as soon as there is one."""
        selector = f"--selector={SHARD}"

        def found() -> list[Any]:
            jobs: Any = self.clusters.manager.get("jobs", selector, f"--namespace={self.namespace}")
            return list(jobs["items"])

        return self.until(found)[0]

    def pods(self, where: str) -> list[Any]:
        """The pods of runs that a cluster has."""
        selector = f"--selector={SHARD}"
        found: Any = self.cluster(where).get("pods", selector, f"--namespace={self.namespace}")
        return list(found["items"])

    def executes(self, where: str) -> bool:
        """Whether a cluster executes all six runs."""
        return [pod["status"]["phase"] for pod in self.pods(where)] == ["Running"] * 6

    def executing(self) -> str:
        """The worker that executes all six runs; empty if none does."""
        return next(filter(self.executes, self.clusters.workers), "")

    def end(self, where: str, *indexes: int, code: int = 0) -> None:
        """Let pods end in a worker."""
        chosen = f"--selector={SHARD},{INDEX} in ({','.join(map(str, indexes))})"
        self.kubectl(where, "annotate", "pods", chosen, f"{EXIT_CODE}={code}")

    def end_all(self, where: str, name: str) -> None:
        """Let all runs pass in a worker; the campaign comes to its end."""
        self.end(where, *range(6))
        self.until(lambda: self.finished(name))
        assert self.runs(name) == (0, 6, 0)

    def left(self, where: str) -> str:
        """What a worker has of campaigns, by name."""
        return self.kubectl(where, "get", "jobs,pods,workloads", "--output=name")


@pytest.fixture
def lab(clusters: Fleet, namespace: str, new_operator: NewOperator) -> Lab:
    """With an operator that looks soon."""
    operator = new_operator(ROBOVAST_STATUS_SECONDS="1", ROBOVAST_STALL_SECONDS="2")
    operator.start()
    return Lab(clusters, namespace, operator)


def test_a_campaign_is_executed_in_the_worker_alone_with_all_that_it_needs(
    lab: Lab, tmp_path: Path
) -> None:
    """Its operator is killed in the middle; the worker goes on."""
    lab.start("mixed", SOUTH)
    lab.until(lambda: lab.executes("south"))
    lab.until(lambda: lab.runs("mixed") == (6, 0, 0))
    assert not lab.pods("manager")
    assert not lab.pods("north")

    pod, made = lab.pods("south")[0], campaign("mixed", lab.namespace, 3, 2)["spec"]
    assert yaml.safe_load(shown(pod, "plan")["document.vast"]) == made["vast"]
    assert plan_of(pod).campaign == lab.status("mixed")["campaign"]
    files = {path: file.read_text() for path, file in inputs_of(pod, tmp_path).items()}
    assert files == made["source"]["inline"]["files"]
    there = lab.kubectl("south", "get", "configmaps", "--output=name")
    assert there.split() == ["configmap/kube-root-ca.crt"]

    lab.end("south", 0)
    lab.end("south", 4, code=10)
    lab.until(lambda: lab.runs("mixed") == (4, 1, 0))
    lab.until(lambda: lab.status("mixed")["runs"]["undecided"] == 1)
    lab.operator.kill()
    lab.end("south", 1, 2, 3, 5)
    lab.until(lambda: lab.job()["status"].get("completedIndexes") == "0-3,5")
    lab.operator.start()
    lab.until(lambda: lab.finished("mixed"))
    assert lab.runs("mixed") == (0, 5, 1)
    verdicts = {
        name: condition(lab.status("mixed"), name)["status"] for name in ("Succeeded", "Passed")
    }
    assert verdicts == {"Succeeded": "True", "Passed": "False"}


def test_a_worker_that_was_lost_for_a_while_goes_on_where_it_was(lab: Lab) -> None:
    start_and_end_half(lab)
    with lab.clusters.workers["south"].cable.pulled():
        lab.until(lambda: lab.stalled("few") == "WorkerLost")
        lab.end("south", 2, 3)
    until_reached(lab.clusters.manager, "south")
    lab.until(lambda: lab.runs("few") == (2, 4, 0))
    lab.until(lambda: not lab.stalled("few"))
    lab.end("south", 4, 5)
    lab.until(lambda: lab.finished("few"))
    assert lab.runs("few") == (0, 6, 0)
    assert created(lab.cluster("south"), lab.namespace, "pods").total() == 6
    lab.until(lambda: not lab.left("south"))


def test_another_worker_goes_on_when_one_is_lost_for_long(lab: Lab) -> None:
    """The campaign is deleted before the first one is back; then nothing is left there."""
    lab.start("few", BOTH)
    first = lab.until(lab.executing)
    other = "north" if first == "south" else "south"
    lab.end(first, 0, 1)
    lab.until(lambda: lab.runs("few") == (4, 2, 0))
    with lab.clusters.workers[first].cable.pulled():
        lab.until(lambda: lab.executes(other))
        lab.until(lambda: lab.runs("few") == (6, 0, 0))
        assert len(lab.pods(first)) == 6
        lab.end_all(other, "few")
        lab.kubectl("manager", "delete", "campaign", "few")
        lab.until(lambda: not lab.left(other))
    until_reached(lab.clusters.manager, first)
    lab.until(lambda: not lab.left(first))


def test_a_worker_that_was_given_up_may_take_the_same_campaign_again(lab: Lab) -> None:
    """It still has the former Job, of the same name: no Job is told of by another one's status."""
    lab.change("north", "clusterqueue", "own", {"stopPolicy": "Hold"})
    lab.start("few", BOTH)
    lab.until(lambda: lab.executes("south"))
    lab.end("south", 0, 1)
    lab.until(lambda: lab.runs("few") == (4, 2, 0))
    former = lab.job()["metadata"]["uid"]
    with lab.clusters.workers["south"].cable.pulled():
        lab.until(lambda: lab.job()["metadata"]["uid"] != former)

    def executed_anew() -> bool:
        """Kueue offers a Job to a worker that is back when it has another reason to look at it."""
        look_at(lab.clusters.manager, "workloads", f"--namespace={lab.namespace}")
        return lab.executes("south")

    until_reached(lab.clusters.manager, "south")
    lab.until(executed_anew)
    lab.change("north", "clusterqueue", "own", {"stopPolicy": "None"})
    lab.end_all("south", "few")


def start_and_end_half(lab: Lab) -> None:
    """Start a campaign in the south, and end the first two of its four Jobs' runs there."""
    lab.start("few", SOUTH)
    lab.until(lambda: lab.executes("south"))
    lab.end("south", 0, 1)
    lab.until(lambda: lab.runs("few") == (4, 2, 0))


def test_a_job_that_somebody_deletes_in_a_worker_begins_anew_there(lab: Lab) -> None:
    start_and_end_half(lab)
    lab.kubectl("south", "delete", "jobs", "--all")
    lab.until(lambda: lab.executes("south"))
    lab.end_all("south", "few")


def test_a_suspended_campaign_has_no_pods_in_its_worker(lab: Lab) -> None:
    start_and_end_half(lab)
    lab.change("manager", "campaign", "few", {"suspend": True})
    lab.until(lambda: not lab.pods("south"))
    lab.until(lambda: lab.runs("few") == (0, 2, 0))
    lab.change("manager", "campaign", "few", {"suspend": False})
    lab.until(lambda: lab.executes("south"))
    lab.end_all("south", "few")


def test_a_campaign_is_executed_where_its_queue_leads_by_now(lab: Lab) -> None:
    """One comes before its queue, whose checks nobody knows then; of another's they are removed.

    The next leader looks at once, this one every half minute.
    """
    manager, turning = lab.clusters.manager, f"turning-{lab.namespace}"
    manager.apply(*queue(turning, SOUTH), local_queue("turning", lab.namespace, turning))
    lab.change("manager", "clusterqueue", turning, {"stopPolicy": "Hold"})
    lab.start("few", "turning")
    lab.start("late", "late")
    lab.until(lambda: lab.stalled("few") == lab.stalled("late") == "QueueUnavailable")

    manager.apply(local_queue("late", lab.namespace, SOUTH))
    lab.cluster("south").apply(local_queue("late", lab.namespace, "own"))
    lab.change(
        "manager", "clusterqueue", turning, {"stopPolicy": "None", "admissionChecksStrategy": None}
    )
    lab.operator.kill()
    lab.operator.start()
    lab.until(lambda: lab.executes("south"))
    lab.end_all("south", "late")
    lab.until(lambda: lab.finished("few"))
    assert lab.runs("few") == (0, 6, 0)
    assert {pod["metadata"]["labels"]["robovast.io/campaign"] for pod in lab.pods("manager")} == {
        "few"
    }
