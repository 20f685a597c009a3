"""Containers that admission adds to our pods decide nothing: our own containers do."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.kube.fake_cluster import SCENARIO, SETTINGS, FakeJob, accepted, campaign

from robovast.kubeapi.pod_contract.messages import Verdicts
from robovast.model.repetition import GroupSizes
from robovast_operator.effects.own_pods import OwnPods
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import format_time, now
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.memory import PodsCache
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Accepted, Rejected, Revision
from robovast_operator.planning.revisions import next_revision
from robovast_operator.planning.shards import ShardPlan, first_attempts
from robovast_operator.pods.first_failures import mishaps_of
from robovast_operator.pods.jobs import shard_job, task_job
from robovast_operator.pods.own import (
    CONTAINERS_ANNOTATION,
    foreign_names,
    is_to_be_ended,
    naming_containers,
)
from robovast_operator.pods.pod_status import troubles_of
from robovast_operator.pods.reports import reports_of
from robovast_operator.pods.stalls import may_store
from robovast_operator.pods.verdicts import ShardRuns, tally_of

NOW = datetime(2026, 11, 21, 8, tzinfo=UTC)
CONTROLLER = "batch.kubernetes.io/controller-uid"
OURS = ("compat-version", "agent", "robovast")
PASSED = '{"passed": "0", "failed": "", "errored": ""}'


def status(name: str, state: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"name": name, "image": "i", "state": state, "started": "running" in state, **more}


def running() -> dict[str, Any]:
    return {"running": {"startedAt": format_time(NOW)}}


def ended(code: int, at: datetime = NOW, message: str = "") -> dict[str, Any]:
    return {"terminated": {"exitCode": code, "finishedAt": format_time(at), "message": message}}


def pod(
    phase: str,
    states: dict[str, dict[str, Any]],
    initial: dict[str, dict[str, Any]] | None = None,
    index: int = 0,
    own: tuple[str, ...] = OURS,
    role: str = "shard",
    job: str = "drive-0",
    **more: Any,
) -> Any:
    initial = initial or {}
    return shaped(
        {
            "metadata": {
                "namespace": "lab",
                "name": f"{job}-{index}",
                "creationTimestamp": format_time(NOW),
                "labels": {"robovast.io/role": role, CONTROLLER: f"uid-{job}"},
                "annotations": {
                    "batch.kubernetes.io/job-completion-index": str(index),
                    CONTAINERS_ANNOTATION: " ".join(own),
                },
            },
            "spec": {
                "nodeName": "n",
                "containers": [{"name": name} for name in states],
                "initContainers": [{"name": name} for name in initial],
            },
            "status": {
                "phase": phase,
                "initContainerStatuses": [status(n, s) for n, s in initial.items()],
                "containerStatuses": [status(n, s) for n, s in states.items()],
                **more,
            },
        }
    )


def action(rules: list[dict[str, Any]], codes: dict[str, int], initialized: bool) -> str:
    """The action that Kubernetes takes for a failed pod, by its documented rules."""
    for rule in rules:
        if "onPodConditions" in rule:
            wanted = {(c["type"], c.get("status", "True")) for c in rule["onPodConditions"]}
            if wanted & {("Initialized", str(initialized))}:
                return str(rule["action"])
            continue
        on = rule["onExitCodes"]
        for name, code in codes.items():
            mine = on.get("containerName") in (None, name)
            if mine and code and (code in on["values"]) == (on["operator"] == "In"):
                return str(rule["action"])
    return "Count"


def rules_of(job: dict[str, Any]) -> list[dict[str, Any]]:
    return list(job["spec"]["podFailurePolicy"]["rules"])


CODES = st.sampled_from([0, 1, 2, 10, 11, 64, 65, 73, 74, 75, 76, 77, 78, 137, 143, 255])
OTHERS = st.dictionaries(st.sampled_from(["istio-proxy", "linkerd", "vault"]), CODES, max_size=3)


def shard_of_campaign() -> tuple[Revision, ShardPlan]:
    made = accepted()
    revision = next_revision(made, (), (), made.identity.child("plan-0"))
    assert revision is not None
    return revision, first_attempts(made.identity, [revision])[0]


def shard_rules() -> list[dict[str, Any]]:
    return rules_of(shard_job(accepted(), SETTINGS, shard_of_campaign()[1]))


@given(CODES, OTHERS)
def test_no_exit_code_of_an_added_container_decides_anything(
    agent: int, others: dict[str, int]
) -> None:
    rules = shard_rules()
    alone = action(rules, {"agent": agent}, initialized=True)
    assert action(rules, {**others, "agent": agent}, initialized=True) == alone
    assert action(rules, {"agent": agent, **others}, initialized=True) == alone


@pytest.mark.parametrize("agent", [0, 10, 11])
def test_no_stored_run_is_repeated(agent: int) -> None:
    codes = {"agent": agent, "istio-proxy": 1}
    assert action(shard_rules(), codes, initialized=True) == "FailIndex"


def test_runs_that_never_started_are_tried_again() -> None:
    assert action(shard_rules(), {"istio-init": 1}, initialized=False) == "Count"


@pytest.mark.parametrize("command", ["compose", "propose", "finish", "process", "purge"])
@given(code=CODES, others=OTHERS)
def test_no_task_is_repeated_for_an_added_container(
    command: str, code: int, others: dict[str, int]
) -> None:
    rules = rules_of(task_job(accepted(), SETTINGS, command, command, "plan-0"))
    alone = action(rules, {command: code}, initialized=True)
    assert action(rules, {**others, command: code}, initialized=True) == alone
    assert code or alone == "FailJob"


def test_a_pod_names_the_containers_that_were_asked_for() -> None:
    named = naming_containers(task_job(accepted(), SETTINGS, "finish", "f", "plan-0"))
    template = named["spec"]["template"]
    template["spec"]["containers"].append({"name": "istio-proxy"})
    template["spec"].setdefault("initContainers", []).append({"name": "istio-init"})
    assert foreign_names(template) == ["istio-init", "istio-proxy"]


MESH = st.dictionaries(
    st.sampled_from(["istio-proxy", "linkerd-proxy", "vault-agent"]),
    st.sampled_from([running(), ended(0), ended(1)]),
    min_size=1,
)


@given(st.sampled_from([0, 10, 11, 74, 75, 137]), MESH)
def test_a_pod_ends_after_our_container(code: int, mesh: dict[str, Any]) -> None:
    found = pod("Running", {"agent": ended(code), "robovast": ended(0), **mesh})
    alive = any("running" in state for state in mesh.values())
    assert is_to_be_ended(found, NOW + timedelta(seconds=11)) is alive
    assert not is_to_be_ended(found, NOW + timedelta(seconds=5))
    found["spec"]["activeDeadlineSeconds"] = 1
    assert not is_to_be_ended(found, NOW + timedelta(seconds=11))


@given(MESH)
def test_no_pod_ends_before_our_container(mesh: dict[str, Any]) -> None:
    found = pod("Running", {"agent": running(), "robovast": running(), **mesh})
    assert not is_to_be_ended(found, NOW + timedelta(days=1))
    assert may_store(found, NOW)


def test_an_agent_may_store_while_an_added_container_waits_for_its_image() -> None:
    waits = {"waiting": {"reason": "ImagePullBackOff"}}
    assert may_store(pod("Pending", {"agent": running(), "istio-proxy": waits}), NOW)


NAMES = st.sampled_from(["finish", "share", "notify", "process", "compose", "istio-proxy"])


@given(NAMES, NAMES, st.sampled_from([running(), ended(0), ended(65), ended(137)]))
def test_the_names_of_other_containers_decide_nothing(
    second: str, mesh: str, state: dict[str, Any]
) -> None:
    """A run's second container and an added one may have the names of our tasks."""
    own = (*OURS, second)
    at_work = {"agent": running(), "robovast": running(), f"{mesh}-2": running(), mesh: state}
    found = pod("Running", at_work, {second: state}, own=own)
    assert not is_to_be_ended(found, NOW + timedelta(days=1))
    assert [told.reason for told in troubles_of(found)] == []
    task = pod("Running", {"finish": running(), "agent": state}, own=("finish",), role="finish")
    assert not is_to_be_ended(task, NOW + timedelta(days=1))
    stored = {"agent": ended(0, message=PASSED), "robovast": ended(0), f"{mesh}-2": running()}
    over = pod("Running", stored, {second: state}, own=own)
    assert is_to_be_ended(over, NOW + timedelta(days=1))
    assert reports_of([over])[0].stored


def test_a_pod_of_ours_alone_is_never_ended() -> None:
    found = pod("Running", {"agent": ended(0), "robovast": running()})
    assert not is_to_be_ended(found, NOW + timedelta(days=1))


def test_an_ended_pod_is_no_mishap() -> None:
    states = {"agent": ended(0, message=PASSED), "robovast": ended(0), "istio-proxy": ended(137)}
    found = pod("Failed", states, reason="DeadlineExceeded", message="active too long")
    assert Verdicts.read(PASSED) is not None
    assert list(troubles_of(found)) == []
    assert mishaps_of([found]) == []
    assert reports_of([found])[0].stored


@pytest.mark.parametrize(
    "initial",
    [
        {"istio-init": ended(1)},
        {"istio-init": running()},
        {"istio-init": {"waiting": {"reason": "ImagePullBackOff"}}},
    ],
)
def test_a_stall_names_the_container_that_blocks(initial: dict[str, Any]) -> None:
    starts = {"waiting": {"reason": "PodInitializing"}}
    told = list(troubles_of(pod("Pending", {"agent": starts}, initial)))
    assert [trouble.reason for trouble in told] == ["ForeignContainer"]
    assert "istio-init" in told[0].message
    assert "not part of the campaign" in told[0].message


class FakeApi:
    """Lists the pods of Jobs and takes patches."""

    def __init__(self, pods: list[Any]) -> None:
        self.pods = pods
        self.patched: list[str] = []
        self.asked = 0

    async def list(self, path: str, labelSelector: str, **_: str) -> AsyncIterator[Any]:  # noqa: N803
        self.asked += 1
        chosen = re.fullmatch(rf"{CONTROLLER} in \((.*)\)", labelSelector)
        assert chosen
        for found in self.pods:
            if found["metadata"]["labels"][CONTROLLER] in chosen[1].split(","):
                yield found

    async def patch(self, path: str, patch: Any) -> None:
        assert patch == {"spec": {"activeDeadlineSeconds": 1}}
        self.patched.append(path.rpartition("/")[2])


def judge(api: FakeApi, jobs: list[JobState], known: PodsCache) -> list[JobState]:
    given = {job.name: job for job in jobs}
    found = asyncio.run(OwnPods(api).judge(given, known))  # type: ignore[arg-type]
    return [found[name] for name in given]


def judged(api: FakeApi, job: JobState) -> tuple[JobState, PodsCache]:
    known = PodsCache()
    return judge(api, [job], known)[0], known


def job(role: str = "shard", size: int = 4, name: str = "drive-0", **more: Any) -> JobState:
    state: JobState = FakeJob(name, role, size, size).state()
    return replace(state, **{"ready": 0, **more})


def pass_by(known: PodsCache, seconds: float, *, moving: bool = False) -> None:
    """The time goes by, with or without the ends of jobs."""
    known.judged_at -= seconds
    known.motion.progressed = time.monotonic() if moving else known.motion.progressed - seconds


PODS = st.lists(st.integers(1, 5), min_size=1, max_size=4)


@given(PODS, st.data())
def test_an_added_container_is_noticed_in_any_pod(sizes: list[int], data: st.DataObject) -> None:
    """A mesh that is enabled later shows only in the pods that are created since then."""
    jobs = [job(name=f"drive-{number}", size=size) for number, size in enumerate(sizes)]
    states = {"agent": running(), "robovast": running()}
    pods = [pod("Running", states, index=n, job=j.name) for j in jobs for n in range(j.size)]
    api, known = FakeApi(pods), PodsCache()
    assert judge(api, jobs, known) == jobs
    place = data.draw(st.integers(0, len(pods) - 1))
    index, name = data.draw(st.sampled_from([(n, j.name) for j in jobs for n in range(j.size)]))
    stored = {"agent": ended(0, message=PASSED), "robovast": ended(0), "mesh": running()}
    api.pods = [p for p in pods if p["metadata"]["name"] != f"{name}-{index}"]
    api.pods.insert(place, pod("Running", stored, index=index, job=name))
    pass_by(known, 11)
    found = judge(api, jobs, known)
    changed = [
        replace(j, active=j.size - 1, ready=j.size - 1) if j.name == name else j for j in jobs
    ]
    assert found == changed
    assert sorted(known.judged[f"uid-{name}"].reports) == [index]
    assert (api.asked, api.patched, known.foreign) == (2, [f"{name}-{index}"], True)


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 9)), max_size=20))
def test_pods_are_not_read_while_jobs_end(steps: list[tuple[bool, int]]) -> None:
    api, known = FakeApi([pod("Running", {"agent": running()})]), PodsCache()
    judge(api, [job()], known)
    still = 0
    for moving, seconds in steps:
        before, still = api.asked, 0 if moving else still + seconds
        pass_by(known, seconds, moving=moving)
        judge(api, [job()], known)
        assert still >= 10 or api.asked == before


@pytest.mark.parametrize(("moving", "most"), [(True, 13), (False, 24)])
def test_pods_without_added_containers_are_read_rarely(moving: bool, most: int) -> None:
    api, known = FakeApi([pod("Running", {"agent": running()})]), PodsCache()
    for _ in range(360):
        pass_by(known, 10, moving=moving)
        judge(api, [job()], known)
    assert 10 < api.asked <= most, "in an hour"


def test_the_pods_of_ended_jobs_are_not_read_again() -> None:
    states = {"agent": ended(0, message=PASSED), "robovast": ended(0), "mesh": running()}
    api, known = FakeApi([pod("Running", states)]), PodsCache()
    judge(api, [job(size=1)], known)
    assert known.foreign
    over = job(size=1, active=0, finished="Complete", completed="0")
    pass_by(known, 1000)
    assert judge(api, [over], known) == [over]
    assert (known.foreign, api.asked) == (False, 1)


@given(st.lists(st.sampled_from(["starts", "runs", "stored"]), min_size=1, max_size=8))
def test_counts_are_those_of_our_containers(kinds: list[str]) -> None:
    starts = {"waiting": {"reason": "PodInitializing"}}
    agents = {"starts": starts, "runs": running(), "stored": ended(0, message=PASSED)}
    pods = [
        pod("Running", {"agent": agents[kind], "robovast": running(), "mesh": running()}, index=n)
        for n, kind in enumerate(kinds)
    ]
    api = FakeApi(pods)
    found, known = judged(api, job(size=len(kinds)))
    assert (found.active, found.ready) == (
        len(kinds) - kinds.count("stored"),
        kinds.count("runs"),
    )
    stored = [n for n, kind in enumerate(kinds) if kind == "stored"]
    assert sorted(known.judged["uid-drive-0"].reports) == stored
    assert api.patched == [f"drive-0-{n}" for n in stored]


def test_a_stored_run_counts_while_its_pod_stays() -> None:
    revision, shard = shard_of_campaign()
    runs = ShardRuns(revision.plan, shard, GroupSizes.parse(""))
    states = {"agent": ended(0, message=PASSED), "robovast": ended(0), "mesh": running()}
    reports = reports_of([pod("Running", states)])
    open_job = job(size=shard.size)
    assert tally_of(runs, open_job, reports).passed == 1
    assert tally_of(runs, replace(open_job, completed="0"), reports).passed == 1
    assert tally_of(runs, replace(open_job, failed="0"), reports).passed == 1


@pytest.mark.parametrize("role", ["compose", "propose", "finish", "process", "purge", "share"])
def test_a_task_is_complete_when_our_container_has_ended_well(role: str) -> None:
    own = (role,)
    done = pod("Running", {role: ended(0, now()), "mesh": running()}, own=own, role=role)
    found, _ = judged(FakeApi([done]), job(role, 1))
    assert found.finished == "Complete"
    lost = job(role, 1, finished="Failed", reason="PodFailurePolicy", active=0)
    ended_pod = pod("Failed", {role: ended(0), "mesh": ended(137)}, own=own, role=role)
    assert judged(FakeApi([ended_pod]), lost)[0].finished == "Complete"
    bad = pod("Failed", {role: ended(65), "mesh": ended(0)}, own=own, role=role)
    assert judged(FakeApi([bad]), lost)[0].finished == "Failed"


FILES = {"scenario.osc": SCENARIO.encode()}
MESH_SETTINGS = replace(
    SETTINGS, pod_annotations=("sidecar.istio.io/inject",), pod_labels=("team",)
)
KEYS = st.dictionaries(
    st.sampled_from(["sidecar.istio.io/inject", "team", "robovast.io/role", "x.io/y"]),
    st.sampled_from(["false", "robots"]),
)


@given(KEYS, KEYS)
def test_pods_get_the_allowed_annotations_and_labels_and_no_others(
    annotations: dict[str, str], labels: dict[str, str]
) -> None:
    obj = campaign(scheduling={"podAnnotations": annotations, "podLabels": labels})
    made = accept(obj, FILES, MESH_SETTINGS)
    if not (annotations.keys() <= {"sidecar.istio.io/inject"} and labels.keys() <= {"team"}):
        assert isinstance(made, Rejected)
        assert made.reason == "PodMetadataNotAllowed"
        assert "policies.podMetadata." in made.message
        return
    assert isinstance(made, Accepted)
    for found in (
        task_job(made, MESH_SETTINGS, "finish", "f", "plan-0"),
        shard_job(made, MESH_SETTINGS, shard_of_campaign()[1]),
    ):
        metadata = found["spec"]["template"]["metadata"]
        assert annotations.items() <= metadata["annotations"].items()
        assert labels.items() <= metadata["labels"].items()
        assert metadata["labels"]["robovast.io/role"] in {"shard", "finish"}
