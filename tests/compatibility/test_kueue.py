"""Campaigns that share a quota of the real Kueue."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import accumulate, pairwise
from typing import Any

import pytest
from robovast_testbed import images
from robovast_testbed.kubernetes import Cluster, Manifest
from support.campaigns.local import make_campaign
from support.kube.held_runs import HELD, release_until_finished
from support.kube.lab import QUICK, SYSTEM, Lab
from support.patience import eventually

KUEUE = "kueue.x-k8s.io/v1beta1"
POD_CPU = 10
"""CPU that a pod asks for when its document asks for nothing [m]."""


def resource_group(namespace: str, pods: int) -> Manifest:
    """Quota for so many pods."""
    quota = {"cpu": f"{pods * POD_CPU + POD_CPU // 2}m", "memory": "100Gi"}
    resources = [{"name": name, "nominalQuota": amount} for name, amount in quota.items()]
    flavors = [{"name": namespace, "resources": resources}]
    return {"coveredResources": list(quota), "flavors": flavors}


def queue_objects(namespace: str) -> list[Manifest]:
    """A queue `lab` with quota for one run, in which what is more urgent comes first."""
    made: list[tuple[str, str, dict[str, Any]]] = [
        ("ResourceFlavor", namespace, {}),
        (
            "ClusterQueue",
            namespace,
            {
                "spec": {
                    "namespaceSelector": {},
                    "resourceGroups": [resource_group(namespace, pods=1)],
                    "queueingStrategy": "StrictFIFO",
                    "preemption": {"withinClusterQueue": "LowerPriority"},
                }
            },
        ),
        ("LocalQueue", "lab", {"spec": {"clusterQueue": namespace}}),
        ("WorkloadPriorityClass", "urgent", {"value": 1000}),
    ]
    return [
        {
            "apiVersion": KUEUE,
            "kind": kind,
            "metadata": {"name": name, "namespace": namespace},
            **rest,
        }
        for kind, name, rest in made
    ]


@pytest.fixture
def queue(kueue_cluster: Cluster, lab: Lab) -> Lab:
    """A namespace with a queue."""
    for obj in queue_objects(lab.namespace):
        if obj["kind"] != "LocalQueue":
            del obj["metadata"]["namespace"]
        kueue_cluster.apply(obj)
    return lab


def change(lab: Lab, name: str, **spec: Any) -> None:
    lab.kubectl("patch", "campaign", name, "--type=merge", "--patch", json.dumps({"spec": spec}))


def running(lab: Lab, name: str) -> None:
    """Wait until a campaign has a pod."""
    active = "--for=jsonpath={.status.runs.active}=1"
    lab.kubectl("wait", f"campaign/{name}", active, "--timeout=180s")


def pods_of(lab: Lab, name: str) -> list[dict[str, Any]]:
    """The pods of a campaign's runs."""
    selector = f"--selector=robovast.io/role=shard,robovast.io/campaign={name}"
    found: list[dict[str, Any]] = lab.get("pods", selector)["items"]
    return found


def workloads_of(lab: Lab, name: str) -> list[dict[str, Any]]:
    """Kueue's Workloads of a campaign."""
    return [
        item
        for item in lab.get("workloads.kueue.x-k8s.io")["items"]
        if item["metadata"]["ownerReferences"][0]["name"].startswith(f"{name}-")
    ]


def stored(lab: Lab, name: str, runs: str = "*/*") -> list[dict[str, Any]]:
    """The records of a campaign's runs in the storage."""
    bucket = lab.campaign(name)["status"]["bucket"]
    shown = f"for file in /data/buckets/{bucket}/{runs}/run.json; do cat $file && echo ,; done"
    command = ("exec", "robovast-s3-0", "--", "sh", "-c", f"{shown} 2>/dev/null || true")
    text = lab.cluster.kubectl("--namespace", SYSTEM, *command).strip().rstrip(",")
    found: list[dict[str, Any]] = json.loads(f"[{text}]")
    return found


def queued(lab: Lab, name: str) -> Any:
    """A campaign's status as soon as that tells its place in the queue."""

    def told() -> Any:
        status = lab.campaign(name).get("status", {})
        return status if status.get("queue") else None

    return eventually(told, told=f"{name} has a place in the queue")


def test_campaigns_take_turns_within_a_quota_for_one_run(queue: Lab) -> None:
    """With the default parallelism: one waits, one is suspended, one deleted, one misled."""
    lab = queue
    lab.quick("one", f'[ "$1" != 1 ] || {HELD}', queueName="lab", select=["one-1", "one-2"])
    running(lab, "one")
    lab.quick("two", "true\n", queueName="lab", select=["one-1"])
    status = queued(lab, "two")
    assert status["state"] == "Queued"
    assert status["queue"]["position"] == status["queue"]["pending"] == 1
    assert "1 of 1" in lab.kubectl("get", "campaigns", "--output=wide")
    seen = lab.vast("exec", "cluster", "monitor", "--once", "-n", lab.namespace).stdout
    assert "place 1 of 1" in seen
    assert "Queued" in seen
    for name in ("paused", "gone"):
        lab.quick(name, "true\n", queueName="lab", select=["one-1"])
        assert queued(lab, name)["queue"]["position"] > 1
    lab.quick("misled", "true\n", queueName="nowhere", select=["one-1"])
    change(lab, "paused", suspend=True)
    lab.kubectl("delete", "campaign", "gone", "--timeout=180s")
    eventually(lambda: not workloads_of(lab, "gone"), told="its Workload goes with it")
    eventually(lambda: [w["spec"]["active"] for w in workloads_of(lab, "paused")] == [False])
    lab.kubectl("wait", "campaign/misled", "--for=condition=Stalled", "--timeout=180s")
    for kind in ("Stalled", "QuotaReserved"):
        message = lab.conditions("misled")[kind]["message"]
        assert "LocalQueue nowhere doesn't exist" in message
        assert "spec.queueName" in message
    change(lab, "misled", queueName="lab")
    release_until_finished(lab, "one")
    for name in ("two", "misled"):
        lab.wait(name)
    assert not pods_of(lab, "paused"), "it was suspended before it had its turn"
    assert lab.campaign("paused")["status"]["state"] == "Suspended"
    change(lab, "paused", suspend=False)
    lab.wait("paused")
    names = {"one": 2, "two": 1, "misled": 1, "paused": 1}
    found = {name: stored(lab, name) for name in names}
    assert {name: len(of_one) for name, of_one in found.items()} == names
    assert {name: len(pods_of(lab, name)) for name in names} == names, "each run in one pod"
    times = sorted((r["started_at"], r["finished_at"]) for some in found.values() for r in some)
    for (_, end), (begin, _) in pairwise(times):
        assert end <= begin, "never two at once"
    assert "queue" not in lab.campaign("two")["status"]


def pack_sizes(records: Sequence[dict[str, Any]]) -> list[int]:
    """How many runs each pack has executed, in the order of the packs."""
    packs = Counter(int(record["job"].rpartition("-")[2]) for record in records)
    return [size for _, size in sorted(packs.items())]


def most_at_once(records: Iterable[dict[str, Any]]) -> int:
    """How many runs were under way at the same time at most."""
    moments = [(record["started_at"], 1) for record in records]
    moments += [(record["finished_at"], -1) for record in records]
    return max(accumulate(change for _, change in sorted(moments)))


def test_measured_packs_grow_and_shrink_and_each_run_is_executed_once(queue: Lab) -> None:
    """With a quota for fewer pods than it may have."""
    lab = queue
    admit(lab, 2)
    script = 'echo run >> "$3/log"\n'
    made = "  runs: 20\n  runs_per_job: auto\n"
    lab.quick("packed", script, made, parallelism=3, queueName="lab")
    lab.wait("packed", seconds=600)
    assert lab.campaign("packed")["status"]["runs"]["passed"] == 60
    records = stored(lab, "packed")
    assert len({(record["variant"], record["run"]) for record in records}) == 60
    sizes = pack_sizes(records)
    assert sizes[:3] == [1, 1, 1], "what a start and a run take is measured first"
    assert max(sizes) >= 5, sizes
    assert sizes[-1] < max(sizes), "nobody waits for a large pack at the end"
    assert most_at_once(records) <= 2
    home = lab.download("packed")
    assert {path.read_text() for path in home.glob("*/*/log")} == {"run\n"}


def urgent_job(namespace: str) -> Manifest:
    """A Job of somebody else that pushes campaigns aside for a moment."""
    container = {
        "name": "urgent",
        "image": images.SLIM,
        "imagePullPolicy": "Never",
        "command": ["sleep", "1"],
        "resources": {"requests": {"cpu": "10m"}},
    }
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {
            "name": "urgent",
            "namespace": namespace,
            "labels": {
                "kueue.x-k8s.io/queue-name": "lab",
                "kueue.x-k8s.io/priority-class": "urgent",
            },
        },
        "spec": {
            "suspend": True,
            "template": {"spec": {"restartPolicy": "Never", "containers": [container]}},
        },
    }


def test_a_campaign_that_is_pushed_aside_goes_on_after_its_last_stored_run(queue: Lab) -> None:
    """Kueue takes its quota away in the middle of a pack; that costs no try."""
    lab = queue
    lab.quick("pushed", f'[ "$1" != 2 ] || {HELD}', "  runs_per_job: 3\n", queueName="lab")
    running(lab, "pushed")
    first = eventually(lambda: stored(lab, "pushed", "one-1/0"), told="the first run is stored")
    lab.cluster.apply(urgent_job(lab.namespace))
    lab.kubectl(
        "wait", "campaign/pushed", "--for=jsonpath={.status.state}=Queued", "--timeout=180s"
    )
    lab.kubectl("wait", "job/urgent", "--for=condition=Complete", "--timeout=180s")
    release_until_finished(lab, "pushed")
    found = stored(lab, "pushed")
    assert [r["verdict"] for r in found] == ["passed"] * 3
    (pod,) = pods_of(lab, "pushed")
    assert pod["metadata"]["annotations"]["batch.kubernetes.io/job-index-failure-count"] == "0"
    assert stored(lab, "pushed", "one-1/0") == first, "it was not repeated"
    (shard,) = lab.get("jobs", "--selector=robovast.io/role=shard")["items"]
    assert shard["status"].get("failed", 0) == 0


def test_what_is_urgent_goes_first_and_a_priority_that_does_not_exist_is_told(queue: Lab) -> None:
    lab = queue
    lab.quick("one", HELD, queueName="lab", select=["one-1", "one-2"])
    running(lab, "one")
    lab.quick("two", "true\n", queueName="lab", select=["one-1"])
    queued(lab, "two")
    spec = {"queueName": "lab", "queuePriorityClassName": "nothing"}
    lab.quick("pressing", "true\n", select=["one-1"], **spec)
    lab.kubectl("wait", "campaign/pressing", "--for=condition=Stalled", "--timeout=180s")
    told = lab.conditions("pressing")["Stalled"]
    assert told["reason"] == "NoPriorityClass"
    assert "no WorkloadPriorityClass nothing" in told["message"]
    change(lab, "pressing", queuePriorityClassName="urgent")
    lab.wait("pressing")
    release_until_finished(lab, "one")
    lab.wait("two")
    (two,), (pressing,) = stored(lab, "two"), stored(lab, "pressing")
    assert pressing["finished_at"] <= two["started_at"]


def admit(lab: Lab, pods: int) -> None:
    """Give the queue quota for so many pods."""
    spec = {"resourceGroups": [resource_group(lab.namespace, pods)]}
    lab.cluster.kubectl(
        *("patch", "clusterqueue", lab.namespace, "--type=merge"),
        *("--patch", json.dumps({"spec": spec})),
    )


def admitted(lab: Lab, name: str) -> int:
    """How many pods of a campaign have quota."""
    jobs = lab.get("jobs", f"--selector=robovast.io/campaign={name}")["items"]
    return sum(job["spec"]["parallelism"] for job in jobs if not job["spec"]["suspend"])


def test_twenty_runs_start_soon_behind_ten_thousand(queue: Lab) -> None:
    """As soon as there is room: the large campaign does not stand in the queue with all it has.

    Its pods stay pending, since no node suits them: a quota is taken all the same.
    """
    lab = queue
    nowhere = {"nodeSelector": {"there": "is-none"}}
    admit(lab, 25)
    many = QUICK.replace("[1, 2, 3]", str(list(range(500))))
    large = make_campaign(lab.folder / "large", "true\n", "  runs: 20\n", many)
    lab.apply(large, "large", queueName="lab", scheduling=nowhere)
    eventually(lambda: admitted(lab, "large") == 25, told="a part of the large one is admitted")
    eventually(
        lambda: len(workloads_of(lab, "large")) == 2, told="its next part stands in the queue"
    )
    time.sleep(1)  # whoever was made in an earlier second is before
    lab.quick(
        "small", "true\n", "  runs: 20\n", queueName="lab", scheduling=nowhere, parallelism=20
    )
    eventually(
        lambda: (place := queued(lab, "small")["queue"])["position"] == place["pending"] == 2,
        told="a single Job of the large one is before it",
    )
    admit(lab, 75)
    eventually(lambda: admitted(lab, "small") == 20, told="the small one is admitted")
    lab.kubectl(
        "wait", "campaign/small", "--for=jsonpath={.status.runs.waiting}=20", "--timeout=180s"
    )
    assert admitted(lab, "large") == 50
