"""Campaigns that share a limited number of pods."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kube.fake_cluster import SCENARIO, SETTINGS, World, accepted, campaign

from robovast.base.errors import InputError
from robovast.kubeapi.resources import CAMPAIGN_LABEL, ROLE_LABEL, UID_LABEL
from robovast_operator.kube.objects import Identity
from robovast_operator.kube.store import JobState, Store
from robovast_operator.planning import shards as shards_module
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Accepted
from robovast_operator.planning.pod_limits import PodLimit, pod_limit, shares
from robovast_operator.settings import read_settings


@given(st.integers(0, 50), st.lists(st.integers(0, 20), max_size=12))
def test_pods_are_shared_evenly_and_none_is_left_that_somebody_wants(
    most: int, wanted: list[int]
) -> None:
    found = shares(most, wanted)
    assert sum(found) == min(most, sum(wanted))
    assert all(0 <= share <= asked for share, asked in zip(found, wanted, strict=True))
    least = min((s for s, a in zip(found, wanted, strict=True) if s < a), default=None)
    if least is not None:
        assert max(found) <= least + 1, "who has more has it only of what cannot be divided"


def test_the_oldest_get_what_cannot_be_divided() -> None:
    assert shares(5, [9, 9, 9]) == [2, 2, 1]
    assert shares(2, [9, 9, 9]) == [1, 1, 0]
    assert shares(10, [9, 1, 9]) == [5, 1, 4]


def put(store: Store, name: str, second: int, status: dict[str, Any], **spec: Any) -> Identity:
    """A Campaign of a namespace, by the second of its creation."""
    obj = campaign(parallelism=10, **spec)
    meta = {"name": name, "uid": f"uid-{name}", "resourceVersion": "1"}
    meta["creationTimestamp"] = f"2026-01-01T00:00:{second:02}Z"
    obj = {**obj, "metadata": {**obj["metadata"], **meta}, "status": status}
    store.put_campaign(obj)
    return Identity.of(obj)


def put_job(store: Store, of: Identity, pods: int, size: int = 100, **spec: Any) -> None:
    labels = {CAMPAIGN_LABEL: of.name, UID_LABEL: of.uid, ROLE_LABEL: "shard"}
    meta = {"namespace": of.namespace, "name": of.child("0"), "uid": "j", "resourceVersion": "1"}
    shape = {"parallelism": pods, "completions": size, **spec}
    store.put_job(JobState.of({"metadata": {**meta, "labels": labels}, "spec": shape}))


RUNNING = {"state": "Running", "runs": {"total": 100}}


def own(store: Store, identity: Identity, most: int = 8) -> tuple[int, bool]:
    found = pod_limit({identity.namespace: most}, store, identity)
    assert found is not None
    return found.own, found.taken


def test_a_campaign_alone_may_have_all_and_two_have_half() -> None:
    store = Store()
    one = put(store, "one", 1, RUNNING)
    assert own(store, one) == (8, False)
    put_job(store, one, 8)
    two = put(store, "two", 2, {})
    assert own(store, one) == (4, False), "but it keeps what it has"
    assert own(store, two) == (0, True)
    put_job(store, one, 2, size=2)
    assert own(store, two) == (4, False)


def test_who_has_no_share_waits_even_while_pods_are_free_for_a_moment() -> None:
    """Older campaigns are about to take them: it would else seem to begin again and again."""
    store = Store()
    older = [put(store, name, second, RUNNING) for second, name in enumerate(("one", "two"))]
    last = put(store, "last", 5, {"state": "Queued"})
    assert own(store, last, 2) == (0, True)
    assert own(store, older[0], 2) == (1, False)
    put_job(store, older[0], 1)
    found = pod_limit({last.namespace: 2}, store, last)
    assert found is not None
    assert found.taken
    assert "other campaigns have them, or come first" in found.told
    assert own(store, put(store, "last", 5, {"state": "Finished"}), 2) == (0, False)


@pytest.mark.parametrize(
    ("status", "spec"),
    [
        ({"state": "Finished", "runs": {"total": 100, "passed": 100}}, {}),
        ({"state": "Running", "runs": {"total": 100, "passed": 90, "undecided": 10}}, {}),
        ({"state": "Rejected"}, {}),
        (RUNNING, {"suspend": True}),
        (RUNNING, {"queueName": "robots"}),
    ],
    ids=["finished", "no run left", "rejected", "suspended", "in a queue"],
)
def test_who_needs_no_pods_leaves_them_to_others(
    status: dict[str, Any], spec: dict[str, Any]
) -> None:
    store = Store()
    put(store, "other", 1, status, **spec)
    one = put(store, "one", 2, RUNNING)
    assert own(store, one) == (8, False)


@pytest.mark.parametrize("state", ["", "Pending"])
def test_who_can_take_none_until_somebody_helps_leaves_them_to_others(state: str) -> None:
    """Such as one whose Jobs the API server refuses; it may have its share as soon as it can."""
    stalled = {"type": "Stalled", "status": "True", "reason": "Refused", "message": ""}
    store = Store()
    broken = put(store, "broken", 1, {"state": state, "conditions": [stalled]})
    one = put(store, "one", 2, RUNNING)
    assert own(store, one, 1) == (1, False)
    assert own(store, one) == (8, False)
    assert own(store, broken) == (4, False)
    put_job(store, broken, 2)
    assert own(store, one) == (4, False), "it has some"


def test_who_has_more_packs_than_its_runs_tell_gets_what_is_free() -> None:
    """Packs may have few runs: those of small Configurations, or that are repeated."""
    store = Store()
    few = {"state": "Running", "runs": {"total": 20}}
    packed = {"execution": {"runs_per_job": 10}}
    one = put(store, "one", 1, few, vast=packed)
    assert own(store, one) == (8, False)
    put(store, "two", 2, few, vast=packed)
    assert own(store, one) == (6, False), "it takes no other's share"


def test_where_verdicts_decide_each_configuration_needs_one_pod() -> None:
    store = Store()
    runs = {"state": "Running", "runs": {"total": 60, "passed": 5, "notNeeded": 15}}
    put(store, "as-needed", 1, runs, vast={"execution": {"runs": {"min": 2, "max": 20}}})
    one = put(store, "one", 2, RUNNING)
    assert own(store, one) == (6, False)


def test_each_namespace_has_a_limit_of_its_own_or_that_of_all_others() -> None:
    store = Store()
    one = put(store, "one", 1, RUNNING)
    assert pod_limit({}, store, one) is None
    assert pod_limit({"elsewhere": 3}, store, one) is None
    others = pod_limit({"*": 3}, store, one)
    assert others == PodLimit(3, 3, taken=False, waiting=())
    own_limit = pod_limit({"*": 3, one.namespace: 5}, store, one)
    assert own_limit == PodLimit(5, 5, taken=False)


def test_settings_are_read_as_the_chart_writes_them() -> None:
    known = {"ROBOVAST_AGENT_IMAGE": "a", "ROBOVAST_S3_ENDPOINT": "http://s3"}
    limits = '{"*":50,"team-a":200}'
    assert read_settings({**known, "ROBOVAST_POD_LIMITS": limits}).pod_limits == {
        "*": 50,
        "team-a": 200,
    }
    with pytest.raises(InputError, match="ROBOVAST_POD_LIMITS"):
        read_settings({**known, "ROBOVAST_POD_LIMITS": "200"})


def going(world: World) -> int:
    """How many pods of runs may be there."""
    jobs = (job for job in world.jobs.values() if job.role == "shard" and not job.suspended)
    return sum(min(job.parallelism, job.size - len(job.done)) for job in jobs)


happenings = st.lists(
    st.tuples(st.sampled_from(["look", "dies amid", "work", "stop", "resume"]), st.integers(0, 5)),
    max_size=50,
)


@settings(max_examples=60, deadline=None)
@given(happenings, st.integers(1, 9))
def test_a_campaign_never_has_more_than_its_share_but_what_it_had_and_loses_no_run(
    events: list[tuple[str, int]], parallelism: int
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shards_module, "SHARD_PACKS", 4)
        world = World(accepted(runs=5, parallelism=parallelism))
        for kind, share in events:
            world.pod_limit = PodLimit(5, share, taken=share == 0)
            before = going(world)
            if kind in ("stop", "resume"):
                world.ask(suspend=kind == "stop")
            else:
                world.meet(kind, share, "passed")
            assert going(world) <= max(before, min(share, parallelism))
        world.ask(suspend=False)
        world.pod_limit = PodLimit(5, 1, taken=False)
        world.settle()
    assert sorted(world.executed) == list(range(15))
    assert world.status.state == "Finished"


@pytest.mark.parametrize(("most", "said"), [(1, "may have 1 pod of"), (2, "may have 2 pods of")])
def test_the_limit_is_told_as_one_says_it(most: int, said: str) -> None:
    assert said in PodLimit(most, 0, taken=True).told


def test_who_waits_for_others_is_queued_and_says_why_and_looks_again() -> None:
    world = World(accepted(runs=5))
    world.pod_limit = PodLimit(5, 0, taken=True)
    found = world.look()
    assert not world.jobs
    assert world.status.state == "Queued"
    told = next(c for c in world.status.conditions if c.type == "QuotaReserved")
    assert (told.status, told.reason) == ("False", "PodLimit")
    assert "5 pods of runs at a time (`operator.podLimits`" in told.message
    assert found.again is not None
    assert world.truth("Stalled") == "False", "nobody has to help"
    world.pod_limit = PodLimit(5, 2, taken=False)
    world.look()
    assert going(world) == 2
    assert world.truth("QuotaReserved") == "True"
    world.pod_limit = None
    world.settle()
    assert world.truth("QuotaReserved") == "True"


def test_measured_packs_share_the_pods_too() -> None:
    world = World(accepted(runs=40, execution={"runs_per_job": "auto"}))
    for share in (0, 3, 0, 2, 5) * 200:
        before = going(world)
        world.pod_limit = PodLimit(5, share, taken=share == 0)
        world.look()
        assert going(world) <= max(before, share)
        world.work()
    assert sorted(world.executed) == list(range(120))


@given(st.integers(1, 3000), st.integers(1, 600))
def test_every_job_has_a_pack_and_every_pack_one_job(packs: int, most: int) -> None:
    found = shards_module.evenly(packs, most)
    assert [pack for first, size in found for pack in range(first, first + size)] == [*range(packs)]
    assert all(size > 0 for _, size in found)


def test_jobs_of_a_limited_campaign_are_small_and_stay_as_they_are_planned() -> None:
    """Others wait for a Job to end; another limit changes no Job that is planned."""
    files = {"scenario.osc": SCENARIO.encode()}
    limited = replace(SETTINGS, pod_limits={"lab": 4})
    made = accept(campaign(), files, limited)
    assert isinstance(made, Accepted)
    assert made.shard_packs == 4
    world = World(replace(made, spec=made.spec.model_copy(update={"runs": 20})))
    world.pod_limit = PodLimit(4, 4, taken=False)
    world.look()
    assert len(world.jobs) == 4
    assert all(job.size <= 4 for job in world.jobs.values())
    queued = accept(campaign(queueName="robots"), files, limited)
    assert isinstance(queued, Accepted)
    assert queued.shard_packs is None
    world.settle()
    assert sorted(world.executed) == list(range(60))
