"""Every reason of docs/how-to/stalled-campaigns.md, by what kubelets report."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kube.fake_cluster import SETTINGS, FakeJob, accepted

from robovast.kubeapi.pod_contract.pack_request import INDEX_ANNOTATION
from robovast_operator.effects.diagnose import STORING, Diagnosis
from robovast_operator.effects.namespace_limits import NamespaceLimitsReader
from robovast_operator.effects.queues import Queues
from robovast_operator.kube.store import JobState, Store
from robovast_operator.kube.times import format_time, now
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.memory import PodsCache
from robovast_operator.pods.job_attempts import TASK_PODS_LOST
from robovast_operator.pods.observations import Trouble
from robovast_operator.pods.own import CONTAINERS_ANNOTATION
from robovast_operator.pods.pod_events import trouble_of_events
from robovast_operator.pods.pod_status import troubles_of
from robovast_operator.pods.stalls import cause_of, unseen_cause

DOCS = Path(__file__).parents[3] / "docs/how-to/stalled-campaigns.md"
NOW = datetime(2026, 11, 21, 8, tzinfo=UTC)
START = format_time(NOW - timedelta(minutes=16))
RUNNING = {"running": {"startedAt": START}}
DONE = {"terminated": {"exitCode": 0, "reason": "Completed"}}
READY = {"type": "Ready", "status": "True", "lastTransitionTime": START}
UNREADY = {
    "type": "Ready",
    "status": "False",
    "reason": "ContainersNotReady",
    "message": "containers with unready status: [agent]",
    "lastTransitionTime": START,
}


def ended(code: int, reason: str = "Error", message: str = "") -> dict[str, Any]:
    return {"terminated": {"exitCode": code, "reason": reason, "message": message}}


def pod(
    phase: str,
    *conditions: dict[str, Any],
    index: int = 0,
    minutes: float = 16,
    metadata: dict[str, Any] | None = None,
    told: dict[str, str] | None = None,
    ready: bool = True,
    started: bool = True,
    **states: dict[str, Any],
) -> Any:
    """A pod as the API server has it, with the states of its containers."""
    containers = [
        {
            "name": name.replace("_", "-"),
            "image": "runs:1",
            "ready": ready,
            "started": started,
            "state": state,
        }
        for name, state in states.items()
    ]
    ours = ("compat-version", "fetch")
    return shaped(
        {
            "metadata": {
                "namespace": "lab",
                "name": f"drive-0-{index}-x{minutes:g}",
                "annotations": {"batch.kubernetes.io/job-completion-index": str(index)},
                "creationTimestamp": format_time(NOW - timedelta(minutes=minutes)),
                **(metadata or {}),
            },
            "spec": {"nodeName": "node-7"},
            "status": {
                "phase": phase,
                "conditions": list(conditions),
                "initContainerStatuses": [c for c in containers if c["name"] in ours],
                "containerStatuses": [c for c in containers if c["name"] not in ours],
                **(told or {}),
            },
        }
    )


def waits(reason: str, message: str = "") -> dict[str, Any]:
    return {"waiting": {"reason": reason, "message": message}}


HOUR = timedelta(hours=1)


def event(reason: str, minutes: float, **more: Any) -> dict[str, Any]:
    """An Event of some minutes ago."""
    return {
        "reason": reason,
        "lastTimestamp": format_time(NOW - timedelta(minutes=minutes)),
        **more,
    }


DELETED = {"deletionTimestamp": format_time(NOW - timedelta(minutes=5))}
BASH = 'exec: "bash": executable file not found in $PATH: unknown'
EVICTED = {"reason": "Evicted", "message": "The node was low on resource: memory."}
NO_ROOM = {"type": "PodScheduled", "status": "False", "message": "0/3 nodes are available"}

MESHED = {"annotations": {INDEX_ANNOTATION: "0", CONTAINERS_ANNOTATION: "robovast agent"}}

CAUSES: dict[str, tuple[str, Any]] = {
    "image cannot be pulled": (
        "ImagePullFailed",
        pod("Pending", compat_version=waits("ImagePullBackOff", "Back-off pulling")),
    ),
    "no node has room": ("Unschedulable", pod("Pending", NO_ROOM)),
    "Secret of the storage is missing": (
        "ContainerConfigError",
        pod("Pending", agent=waits("CreateContainerConfigError", "secret not found")),
    ),
    "wrong architecture": (
        "ContainerError",
        pod("Failed", compat_version=ended(255, message="exec /bin/sh: exec format error")),
    ),
    "no bash in the image": (
        "ContainerError",
        pod("Running", UNREADY, robovast=ended(128, "StartError", BASH), agent=RUNNING),
    ),
    "no shell in the image": (
        "ContainerError",
        pod("Failed", compat_version=ended(128, "StartError", "no such file or directory")),
    ),
    "container of a mesh": (
        "ForeignContainer",
        {
            **pod("Running", metadata=MESHED, robovast=DONE, agent=DONE, istio_proxy=RUNNING),
            "spec": {"containers": [{"name": n} for n in ("robovast", "agent", "istio-proxy")]},
        },
    ),
    "own container out of memory": (
        "OutOfMemory",
        pod("Failed", compat_version=ended(137, "OOMKilled")),
    ),
    "agent out of memory": (
        "OutOfMemory",
        pod("Failed", robovast=DONE, agent=ended(137, "OOMKilled")),
    ),
    "storage cannot be used": (
        "StorageUnavailable",
        pod("Failed", agent=ended(74, message="no server at http://s3:9000")),
    ),
    "fetch of an earlier operator": (
        "StorageUnavailable",
        pod("Failed", fetch=ended(74, message="no server at http://s3:9000")),
    ),
    "process that prepares out of memory": (
        "OutOfMemory",
        pod("Failed", robovast=DONE, agent=ended(75, "OOMKilled", '{"error": "by SIGKILL"}')),
    ),
    "evicted": (
        "Evicted",
        pod(
            "Failed",
            told=EVICTED,
            agent=ended(137, "ContainerStatusUnknown"),
        ),
    ),
    "refused by the node": (
        "PodRejected",
        pod("Failed", told={"reason": "OutOfcpu", "message": "Node didn't have enough resource"}),
    ),
    "node does not answer": (
        "NodeLost",
        pod("Running", READY | {"status": "False"}, robovast=RUNNING, agent=RUNNING),
    ),
    "pod cannot end on a lost node": (
        "NodeLost",
        pod("Running", READY, metadata=DELETED, robovast=RUNNING, agent=RUNNING),
    ),
    "run hangs": (
        "NoLogOutput",
        pod("Running", UNREADY, ready=False, robovast=RUNNING, agent=RUNNING),
    ),
}
"""By name: the reason that is told, and a pod."""


def job(**status: Any) -> JobState:
    """The Job of 300 packs, with pods that come to nothing."""
    state = FakeJob("drive-0", "shard", 300, 100).state()
    return replace(state, **{"active": 1, "ready": 0, **status})


def cause(*pods: Any, at_work: bool = False, **status: Any) -> Trouble | None:
    return cause_of(pods, job(**status), NOW, 1800, at_work=at_work)


@pytest.mark.parametrize(("reason", "told"), CAUSES.values(), ids=list(CAUSES))
def test_each_cause_is_told(reason: str, told: Any) -> None:
    found = cause(told)
    assert found is not None
    assert (found.reason, found.final) == (reason, False)
    assert len(found.message) > 20


def test_a_pod_that_is_being_prepared_for_long_is_not_silent() -> None:
    slow = pod("Running", UNREADY, ready=False, started=False, robovast=RUNNING, agent=RUNNING)
    assert cause(slow) is None


def test_what_a_server_refuses_from_the_start_it_refuses_every_pod() -> None:
    refused = {code: cause(pod("Failed", agent=ended(code))) for code in (76, 77)}
    told = {code: (t.reason, t.final) for code, t in refused.items() if t is not None}
    assert told == {76: ("StorageDenied", True), 77: ("StorageDenied", False)}


def test_the_table_of_causes_names_all_of_them() -> None:
    """Quota and Refused are told by events alone, lost words by what becomes of Jobs."""
    table = DOCS.read_text()
    rows = re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)
    documented = set(re.findall(r"\w+", " ".join(rows)))
    by_events = {
        found.reason
        for reason in ("exceeded quota", "violates PodSecurity")
        if (found := trouble_of_events([event("FailedCreate", 0, message=reason)], NOW - HOUR))
    }
    elsewhere = {"WorkerLost", "NoWorkerPods"}
    elsewhere |= {"NameConflict", "BucketConflict", "StorageDenied", "RunListMissing"}
    by_words = by_events | elsewhere | {TASK_PODS_LOST, STORING}
    assert {reason for reason, _ in CAUSES.values()} | by_words == documented


@pytest.mark.parametrize(
    ("ready", "worker", "active", "told"),
    [
        (1, "south", "True", ""),
        (1, "south", "False", "WorkerLost"),
        (0, "south", "False", "WorkerLost"),
        (0, "south", "True", "NoWorkerPods"),
        (1, "south", "", ""),
        (0, "south", "", "NoWorkerPods"),
        (0, "", "", ""),
    ],
)
def test_no_run_is_lost_because_its_pod_is_in_another_cluster(
    ready: int, worker: str, active: str, told: str
) -> None:
    """Only what Kueue says of that cluster, and of the Job, is told; silence is no trouble."""
    state = {"type": "Active", "status": active, "message": "no route to host"}
    cluster = {"status": {"conditions": [state]}} if active else None
    found = unseen_cause(job(active=1, ready=ready, elsewhere=True), worker, cluster)
    assert (found.reason if found else "") == told
    assert found is None or worker in found.message


def test_what_was_in_the_way_of_pods_before_is_over() -> None:
    old = pod("Failed", agent=ended(74, message="no server"), index=1, minutes=90)
    assert cause(old, completed="0-5") is None
    assert cause(old, failed="1") is None
    newer = [pod("Pending", index=1, minutes=m, agent=RUNNING) for m in (2, 5)]
    assert cause(*newer, old) is None
    found = cause(newer[0], old)
    assert found is not None, "the last one before it tells, as long as the newest says nothing"
    assert found.reason == "StorageUnavailable"


def test_pods_that_wait_are_no_stall_while_others_work() -> None:
    waiting = [pod("Pending", NO_ROOM, index=i) for i in range(80)]
    dead = pod("Failed", agent=ended(74), index=90)
    assert cause(*waiting, dead, at_work=True, active=100, ready=20) is None
    found = cause(*waiting, dead, active=100)
    assert found is not None


def test_pods_that_die_again_and_again_are_a_stall_though_others_start() -> None:
    deaths = [pod("Failed", told=EVICTED, minutes=minutes) for minutes in (12, 8, 4)]
    assert cause(*deaths[:2], at_work=True, ready=1) is None
    found = cause(*deaths, at_work=True, ready=1)
    assert found is not None
    assert (found.reason, found.deadly) == ("Evicted", True)
    assert found.message.startswith("3 pods failed")
    assert cause(*deaths, at_work=True, active=100, ready=99) is None, "one of a hundred"
    old = [pod("Failed", told=EVICTED, minutes=minutes) for minutes in (60, 50, 40)]
    assert cause(*old, at_work=True, ready=1) is None, "the next one has lived for longer"
    lost = [pod("Failed", agent=ended(75), index=0, minutes=m) for m in range(5)]
    assert cause(*lost, at_work=True, ready=1) is None, "how runs end is a result"


class Server:
    """Has pods, and says how often it was asked."""

    def __init__(self, *pods: Any) -> None:
        self.pods = pods
        self.events: dict[str, list[Any]] = {}
        self.asked = 0

    async def list(self, path: str, **selection: str) -> AsyncIterator[Any]:
        self.asked += 1
        wanted = selection.get("fieldSelector", "")
        if path.endswith("/events"):
            for found in self.events.get(wanted.removeprefix("involvedObject.uid="), ()):
                yield found
            return
        for found in self.pods:
            if wanted != "status.phase=Failed" or found["status"]["phase"] == "Failed":
                yield found


def diagnosis_of(server: Any) -> Diagnosis:
    return Diagnosis(
        server, SETTINGS, Queues(server, Store(), SETTINGS), NamespaceLimitsReader(server)
    )


class Campaign:
    """One Job, and what is remembered of it as time goes by."""

    def __init__(self, *pods: Any) -> None:
        self.server: Any = Server(*pods)
        self._known = PodsCache()
        self._diagnosis = diagnosis_of(self.server)

    def pass_by(self, seconds: float, **status: Any) -> str:
        """The time goes by, and then it is looked; returns what is told."""
        self._known.motion.expect_stall(seconds)
        self._known.diagnosed -= seconds
        self._known.looked -= seconds
        jobs = {"drive-0": job(**status)}
        found = asyncio.run(self._diagnosis.findings(accepted(), self._known, jobs))
        return found.trouble.reason if found.trouble else ""


@pytest.mark.parametrize(
    ("left", "storing"),
    [
        ((), False),
        ((pod("Running", READY, robovast=RUNNING, agent=RUNNING),), True),
        ((pod("Running", UNREADY, robovast=DONE, agent=RUNNING),), True),
        ((CAUSES["pod cannot end on a lost node"][1],), False),
        ((pod("Running", UNREADY, robovast=RUNNING, agent=DONE),), False),
        ((pod("Running", READY, debugger=RUNNING),), False),
    ],
)
def test_the_index_waits_for_agents_whose_jobs_are_gone(
    left: tuple[Any, ...], *, storing: bool
) -> None:
    server: Any = Server(*left)
    identity = accepted().identity
    diagnosis, known = diagnosis_of(server), PodsCache()
    assert bool(asyncio.run(diagnosis.storing(identity))) == storing
    for seconds, told in ((0, False), (1000, storing)):
        known.motion.moved -= seconds
        assert asyncio.run(diagnosis.hold_back(identity, known)) == storing
        assert (known.trouble is not None) == told


def test_an_image_of_assets_that_cannot_be_pulled_is_named_in_place_of_the_runs() -> None:
    said = waits("ImagePullBackOff", 'Back-off pulling image "lab/worlds:1"')
    found = pod("Pending", robovast=said)
    volumes = [{"name": "work", "emptyDir": {}}, {"image": {"reference": "lab/worlds:1"}}]
    found["spec"]["volumes"] = volumes
    (trouble,) = troubles_of(found)
    assert trouble.message.startswith(
        "Cannot pull the image lab/worlds:1 of `execution.kubernetes.assets`"
    )
    found["spec"]["volumes"] = volumes[:1]
    (trouble,) = troubles_of(found)
    assert trouble.message.startswith("Cannot pull the image runs:1 of the runs")


def test_a_pod_without_a_node_says_where_to_look() -> None:
    (trouble,) = troubles_of(pod("Pending", NO_ROOM))
    assert "0/3 nodes are available. Compare the resources of the nodes" in trouble.message


def test_a_stall_neither_flaps_nor_stays() -> None:
    _, pull = CAUSES["image cannot be pulled"]
    campaign = Campaign(pull)
    stall = SETTINGS.stall_seconds
    assert campaign.pass_by(1) == ""
    assert campaign.pass_by(stall) == "ImagePullFailed"
    assert campaign.pass_by(1, active=2) == "ImagePullFailed", "another such pod changes nothing"
    assert campaign.pass_by(1, active=2, ready=1) == "", "pods are at work"
    assert campaign.pass_by(1, active=2, ready=1, completed="0") == ""
    assert campaign.pass_by(1, active=1, ready=0, completed="0") == ""
    campaign.server.pods = (pod("Pending", NO_ROOM, index=7, minutes=1),)
    assert campaign.pass_by(stall, active=1, completed="0") == "Unschedulable"


def test_an_old_event_explains_no_stall() -> None:
    held = pod("Pending", ready=False, compat_version=DONE, robovast=waits("PodInitializing"))
    held["metadata"]["uid"] = "a"
    spec = {"name": "robovast", "lifecycle": {"postStart": {"exec": {}}}}
    held["spec"]["containers"] = [spec]
    campaign = Campaign(held)
    mount = event("FailedMount", 15, message="configmap not found")
    place = {"involvedObject": {"fieldPath": "spec.containers{robovast}"}}
    campaign.server.events = {"a": [mount]}
    stall = SETTINGS.stall_seconds
    assert campaign.pass_by(stall) == "ContainerConfigError"
    campaign.server.events = {"a": [event("Pulled", 14, **place), mount]}
    assert campaign.pass_by(10 * stall) == ""
    campaign.server.events["a"].append(event("Started", 14, **place))
    assert campaign.pass_by(20 * stall) == "ContainerError"


def test_a_job_without_pods_is_explained_by_its_own_events() -> None:
    """Whatever is known of pods that have ended."""
    dead = pod("Failed", minutes=8, agent=ended(75))
    dead["metadata"]["uid"] = "a"
    campaign = Campaign(dead)
    stall = SETTINGS.stall_seconds
    refused = event("FailedCreate", 9, message="violates PodSecurity")
    campaign.server.events = {"a": [event("FailedMount", 1)], "uid-drive-0": [refused]}
    assert campaign.pass_by(stall, active=0) == ""
    campaign.server.events["uid-drive-0"] = [refused | event("FailedCreate", 7)]
    assert campaign.pass_by(10 * stall, active=0) == "RequestDenied"


def test_pods_at_work_are_left_in_peace() -> None:
    campaign = Campaign(pod("Running", READY, robovast=RUNNING, agent=RUNNING))
    for _ in range(240):
        assert campaign.pass_by(30, active=1, ready=1) == ""
    assert campaign.server.asked < 40, "in two hours"


def test_deaths_one_after_the_other_are_told_and_stay_told() -> None:
    campaign = Campaign()
    told = []
    for number in range(12):
        dead = pod("Failed", told=EVICTED, minutes=0)
        dead["metadata"] |= {"name": f"x{number}", "creationTimestamp": format_time(now())}
        campaign.server.pods = (*campaign.server.pods, dead)
        told += [campaign.pass_by(120, active=1, ready=1), campaign.pass_by(5, active=0)]
    assert told[-12:] == ["Evicted"] * 12
    assert told[:4] == [""] * 4


NO_SERVER = {"agent": ended(74, message="no server")}
STEPS: dict[str, tuple[Any, dict[str, int]]] = {
    "fails": (("Failed", NO_SERVER), {"active": 0, "ready": 0}),
    "is gone": (None, {}),
    "starts": (("Pending", {}), {"active": 1, "ready": 0}),
    "runs": (("Running", {"robovast": RUNNING, "agent": RUNNING}), {"active": 1, "ready": 1}),
    "is given up": (None, {}),
    "is queued again": (None, {}),
}
"""What happens to the pod of an index: its phase and containers, and the counts of its Job."""


@settings(max_examples=25, deadline=None)
@given(
    steps=st.lists(
        st.tuples(st.sampled_from(sorted(STEPS)), st.sampled_from([1, 20, 70])), max_size=25
    ),
    verdict=st.booleans(),
)
def test_a_stall_lasts_until_something_succeeds(
    steps: list[tuple[str, float]], *, verdict: bool
) -> None:
    """Pods fail, vanish and start in any order; indexes may be given up without a verdict."""
    first = pod("Failed", agent=ended(74, message="no server at http://s3:9000"), minutes=0)
    campaign = Campaign(first)
    assert campaign.pass_by(SETTINGS.stall_seconds) == "StorageUnavailable"
    status: dict[str, Any] = {"active": 1}
    given_up = 0
    for number, (step, seconds) in enumerate(steps):
        shown, counts = STEPS[step]
        status |= counts
        if step == "is gone":
            campaign.server.pods = ()
        elif step == "is given up":
            given_up += 1
            status |= {"failed": f"0-{given_up - 1}"}
        elif step == "is queued again":
            status |= {"suspended": not status.get("suspended", False)}
        else:
            new = pod(shown[0], index=given_up, **shown[1])
            new["metadata"] |= {"name": f"x{number}", "creationTimestamp": format_time(now())}
            campaign.server.pods = (*campaign.server.pods, new)
        assert campaign.pass_by(seconds, **status) == "StorageUnavailable"
    if verdict:
        dead = pod("Failed", index=given_up, minutes=0, agent=ended(10))
        campaign.server.pods = (dead,)
        status |= {"failed": f"0-{given_up}"}
    else:
        status |= {"completed": "200"}
    campaign.pass_by(1, active=1, ready=1, **{k: v for k, v in status.items() if "ed" in k})
    assert campaign.pass_by(11, **{**status, "active": 1, "ready": 1, "suspended": False}) == ""
