"""Replicas of the operator that are killed, paused and started again."""

from __future__ import annotations

import random
import signal
import threading
import time
from typing import Any

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.faulty_proxy import FaultyApi, delay, faulty_api, hold
from support.kube.operator_process import (
    ACCOUNT,
    SYSTEM,
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    created,
    finished,
    status,
    write_requests,
)
from support.patience import eventually

LEASE_SECONDS = 2
KILLS = 10


@pytest.fixture
def replicas(namespace: str, new_operator: NewOperator) -> dict[str, OperatorProcess]:
    """Two operators that have not been started."""
    names = (f"first-{namespace}", f"second-{namespace}")
    return {name: new_operator(name, ROBOVAST_LEASE_SECONDS=str(LEASE_SECONDS)) for name in names}


def holder(cluster: Cluster) -> str:
    """Who holds the Lease."""
    try:
        lease: Any = cluster.get("lease", "robovast-operator", f"--namespace={SYSTEM}")
    except Exception:
        return ""
    return str(lease["spec"].get("holderIdentity") or "")


def start_and_hear(operator: OperatorProcess, leader: str) -> None:
    """Start an operator, and wait until it knows who leads."""
    told = f"{leader} leads"
    before = operator.told().count(told)
    operator.start()
    eventually(lambda: operator.told().count(told) > before, told=operator.told)


def addition(namespace: str, name: str, value: int) -> dict[str, Any]:
    """A Configuration that adds twenty runs."""
    return {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Configuration",
        "metadata": {"name": name, "namespace": namespace},
        "spec": {"campaign": "hunted", "parameters": [{"x": value}], "runs": 20},
    }


def transitions(cluster: Cluster) -> int:
    """How often the Lease has come to another holder."""
    lease: Any = cluster.get("lease", "robovast-operator", f"--namespace={SYSTEM}")
    return int(lease["spec"]["leaseTransitions"])


def test_a_leader_that_is_killed_ten_times_is_followed_each_time_and_makes_nothing_twice(
    fake_cluster: Cluster, namespace: str, replicas: dict[str, OperatorProcess]
) -> None:
    """More runs are asked for all the while: of 300 in 11 Jobs, each is executed once."""
    chance = random.Random(11)  # noqa: S311
    leader, other = replicas
    start_and_hear(replicas[leader], leader)
    before = transitions(fake_cluster)
    start_and_hear(replicas[other], leader)
    fake_cluster.apply(campaign("hunted", namespace, 1, 100, parallelism=40))
    for number in range(KILLS):
        fake_cluster.apply(addition(namespace, f"more-{number}", number))
        time.sleep(chance.uniform(0, 1))
        replicas[leader].kill()
        dead, leader = leader, next(name for name in replicas if name != leader)
        eventually(lambda: holder(fake_cluster) == leader)  # noqa: B023
        start_and_hear(replicas[dead], leader)

    def ended() -> bool:
        runs = status(fake_cluster, namespace, "hunted").get("shards", [])
        all_there = len(runs) == 1 + KILLS
        return all_there and finished(fake_cluster, namespace, "hunted")

    eventually(ended, 300, replicas[leader].told)
    state = status(fake_cluster, namespace, "hunted")
    assert (state["progress"], state["state"]) == ("300/300", "Finished")
    assert condition(state, "Passed")["status"] == "True"
    jobs = created(fake_cluster, namespace, "jobs")
    assert set(jobs.values()) == {1}
    shards = [name for name in jobs if "finish" not in name]
    assert len(shards) <= 1 + KILLS, "one whose maker was killed before the answer is not counted"
    assert created(fake_cluster, namespace, "pods").total() == 300 + len(jobs) - len(shards)
    assert transitions(fake_cluster) - before >= KILLS


def test_a_leader_that_slept_while_the_other_took_over_does_nothing_more(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """It sleeps amid a look at the Campaign: its Job is being made, its status not yet written."""
    with faulty_api(fake_cluster) as proxy:
        asleep = new_operator(f"asleep-{namespace}", server=proxy.address)
        awake = new_operator(f"awake-{namespace}")
        fell_asleep = threading.Event()
        creation = proxy.break_("POST", "/jobs", hold(fell_asleep, delay(0)), 1)
        asleep.start()
        try:
            eventually(lambda: f"asleep-{namespace} leads" in asleep.told())
            awake.start()
            fake_cluster.apply(campaign("few", namespace, 3, 2))
            eventually(lambda: creation.hits, 30)
            asleep.signal(signal.SIGSTOP)
            fell_asleep.set()
            eventually(lambda: finished(fake_cluster, namespace, "few"), told=awake.told)
            before = len(proxy.seen)
            asleep.signal(signal.SIGCONT)
            eventually(lambda: "another replica may be the leader" in asleep.told())
            time.sleep(1)
            assert writes_of(proxy, before) == []
        finally:
            asleep.signal(signal.SIGCONT)
            asleep.stop()  # before the proxy, through which it lets go of the Lease
    state = status(fake_cluster, namespace, "few")
    assert (state["progress"], state["state"]) == ("6/6", "Finished")
    assert sorted(created(fake_cluster, namespace, "jobs").values()) == [1, 1]
    assert created(fake_cluster, namespace, "pods").total() == 6 + 1


def writes_of(proxy: FaultyApi, since: int) -> list[tuple[str, str]]:
    """What has been changed through a proxy, attempts to lead left out."""
    return [
        (method, path)
        for _, method, path, _ in proxy.seen[since:]
        if method != "GET" and "/leases" not in path
    ]


def test_a_restart_tells_the_truth_first_of_all_and_the_end_costs_no_write(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """Five seconds of CPU are enough for it, the start included; a busy machine takes longer."""
    operator = new_operator(ROBOVAST_LEASE_SECONDS="15", ROBOVAST_RESYNC_SECONDS="5")
    operator.start()
    fake_cluster.kubectl("cordon", "--selector=type=kwok")  # no run ends while it is there
    try:
        fake_cluster.apply(campaign("few", namespace, 3, 2))
        (name,) = eventually(lambda: created(fake_cluster, namespace, "jobs"))
        operator.kill()
    finally:
        fake_cluster.kubectl("uncordon", "--selector=type=kwok")
    fake_cluster.kubectl(
        *("--namespace", namespace, "wait", f"job/{name}", "--for=condition=Complete"),
        "--timeout=60s",
    )
    known = status(fake_cluster, namespace, "few").get("progress", "")
    shown = ("--output=jsonpath={.status.progress}{'\\n'}", f"--namespace={namespace}")
    with fake_cluster.watching("campaign", "few", *shown) as told:
        operator.start()
        first = next((text for text in told if text != known), "")
        cpu, _ = operator.usage()
    assert first == "6/6"
    assert cpu <= 5
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    eventually(lambda: not writes_in(fake_cluster, 3), 60, "the operator goes on writing")
    since = fake_cluster.audit_log.stat().st_size
    time.sleep(8)
    operator.kill()
    operator.start()
    time.sleep(12)
    found = operators_writes(fake_cluster, since)
    assert found <= {f"{ACCOUNT} leases"}, found


def operators_writes(cluster: Cluster, since: int) -> set[str]:
    """What an operator has written since then, by kind."""
    return {kind for kind in write_requests(cluster, since) if ACCOUNT in kind}


def writes_in(cluster: Cluster, seconds: float) -> set[str]:
    """What an operator writes in so many seconds beside its Lease."""
    since = cluster.audit_log.stat().st_size
    time.sleep(seconds)
    return operators_writes(cluster, since) - {f"{ACCOUNT} leases"}


def test_a_namespace_with_buckets_to_delete_goes_once_the_operator_is_back(
    fake_cluster: Cluster, namespace: str, new_operator: NewOperator
) -> None:
    """A finalizer waits for the operator, and in a namespace that goes no Job can be made."""
    operator = new_operator()
    operator.start()
    fake_cluster.apply(campaign("few", namespace, 3, 2, storage={"retention": "Delete"}))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    operator.kill()
    fake_cluster.kubectl("delete", "namespace", namespace, "--wait=false")
    left = ("get", "campaigns", f"--namespace={namespace}", "--output=name")
    time.sleep(3)
    assert fake_cluster.kubectl(*left).split() == ["campaign.robovast.io/few"]
    operator.start()
    fake_cluster.kubectl("wait", "--for=delete", f"namespace/{namespace}", "--timeout=60s")
    assert "its namespace is being deleted" in operator.told()
    fake_cluster.kubectl("create", "namespace", namespace)
