"""The operator behind an API server that breaks: nothing lost, nothing twice, no ghosts."""

from __future__ import annotations

import asyncio
import json
import re
import threading
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from aiohttp import web
from robovast_testbed.kubernetes import Cluster
from support.kube.faulty_proxy import (
    Action,
    Answer,
    FaultyApi,
    Forward,
    cut_answer,
    cut_first_event,
    cut_in_the_middle,
    delay,
    fail_after,
    faulty_api,
    hold,
    refuse,
    watch_error,
)
from support.kube.operator_process import (
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    created,
    finished,
    free_port,
    page,
    status,
)
from support.patience import eventually

NOWHERE = {"scheduling": {"nodeSelector": {"no": "node"}}}
"""Runs that wait for ever."""


@pytest.fixture
def proxy(fake_cluster: Cluster) -> Iterator[FaultyApi]:
    with faulty_api(fake_cluster) as made:
        yield made


@pytest.fixture
def start(proxy: FaultyApi, new_operator: NewOperator) -> Iterator[NewOperator]:
    """Start an operator behind the proxy."""

    def begin(**settings: str) -> OperatorProcess:
        operator = new_operator(server=proxy.address, **{"ROBOVAST_LEASE_SECONDS": "3", **settings})
        operator.start()
        return operator

    yield begin
    proxy.mend()


def assert_right(cluster: Cluster, namespace: str) -> None:
    """Each of the six runs has been executed once, and the Campaign says so."""
    state = status(cluster, namespace, "few")
    assert (state["progress"], state["state"]) == ("6/6", "Finished")
    assert condition(state, "Passed")["status"] == "True"
    jobs = created(cluster, namespace, "jobs")
    assert sorted(jobs.values()) == [1, 1], jobs
    assert created(cluster, namespace, "pods").total() == 6 + 1


def watching(proxy: FaultyApi) -> bool:
    """Whether all three streams are there."""
    return len(proxy.open_watches("resourceVersion=\\d|sendInitialEvents")) >= 3


def test_watches_that_die_silently_are_noticed(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    operator = start(ROBOVAST_SILENCE_SECONDS="3")
    eventually(lambda: watching(proxy), told=operator.told)
    assert proxy.silence_watches() >= 3
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), 30, operator.told)
    assert_right(fake_cluster, namespace)


def test_watches_that_are_cut_again_and_again_tell_all_the_same(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    operator = start()
    eventually(lambda: watching(proxy), told=operator.told)
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    cuts = 0
    deadline = time.monotonic() + 180
    while not finished(fake_cluster, namespace, "few"):
        assert time.monotonic() < deadline, operator.told()
        cuts += proxy.cut_watches()
        time.sleep(0.3)
    assert cuts > 5
    assert_right(fake_cluster, namespace)


def test_a_first_list_that_is_cut_off_hides_no_campaign(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    names = [f"waits-{number}" for number in reversed(range(5))]
    fake_cluster.apply(*(campaign(name, namespace, 1, 1, suspend=True) for name in names))
    cut = proxy.break_("GET", "/campaigns.*watch=true", cut_first_event, 1)
    operator = start()
    for name in names:
        eventually(lambda name=name: status(fake_cluster, namespace, name), told=operator.told)
    assert cut.hits == 1


def test_an_operator_that_may_not_list_is_not_ready_and_works_as_soon_as_it_may(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    port = free_port()
    refused = proxy.break_("GET", r"/jobs\?(?!.*watch=)", refuse(403))
    operator = start(ROBOVAST_PORT=str(port))
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: refused.hits > 1, 30, operator.told)
    assert (page(port, "healthz"), page(port, "readyz")) == ("ok", "")
    assert status(fake_cluster, namespace, "few") == {}
    assert "cannot be listed" in operator.told()
    proxy.mend()
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert page(port, "readyz") == "ok"


def test_a_finalizer_that_somebody_adds_meanwhile_stays(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    def set_finalizers(*names: str) -> None:
        patch = json.dumps({"metadata": {"finalizers": names}})
        about = (f"--namespace={namespace}", "patch", "campaign", "few", "--type=merge")
        fake_cluster.kubectl(*about, f"--patch={patch}")

    async def be_faster(request: web.Request, forward: Forward) -> Answer:
        del request
        await asyncio.to_thread(set_finalizers, "example.org/theirs")
        return await forward()

    faster = proxy.break_("PATCH", r"/campaigns/few(\?|$)", be_faster, 1)
    operator = start()
    fake_cluster.apply(
        campaign("few", namespace, 1, 1, suspend=True, storage={"retention": "Delete"})
    )

    def finalizers() -> set[str]:
        found: Any = fake_cluster.get("campaign", "few", f"--namespace={namespace}")
        return set(found["metadata"].get("finalizers", ()))

    both = {"example.org/theirs", "robovast.io/purge"}
    eventually(lambda: finalizers() == both, 30, operator.told)
    assert faster.hits == 1
    operator.stop()
    set_finalizers()


def test_a_server_that_cannot_stream_lists_is_listed_and_watched(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    busy = proxy.break_("GET", "sendInitialEvents", refuse(503), 1)
    refused = proxy.break_("GET", "sendInitialEvents", refuse(422))
    operator = start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert_right(fake_cluster, namespace)
    assert operator.alive
    assert (busy.hits, refused.hits) == (1, 1)


def test_what_was_deleted_while_history_was_lost_leaves_no_ghost(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    port = free_port()
    operator = start(ROBOVAST_RESYNC_SECONDS="5", ROBOVAST_PORT=str(port))
    fake_cluster.apply(campaign("few", namespace, 3, 2, **NOWHERE))
    fake_cluster.apply(campaign("gone", namespace, 1, 1, **NOWHERE))
    added = {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Configuration",
        "metadata": {"name": "more", "namespace": namespace},
        "spec": {"campaign": "few", "name": "more", "parameters": [{"x": 7}]},
    }

    def total(runs: int) -> bool:
        return bool(status(fake_cluster, namespace, "few").get("runs", {}).get("total") == runs)

    def jobs() -> dict[str, str]:
        found: Any = fake_cluster.get("jobs", f"--namespace={namespace}")
        return {job["metadata"]["name"]: job["metadata"]["uid"] for job in found["items"]}

    eventually(lambda: total(6) and len(jobs()) == 2, 30, operator.told)
    fake_cluster.apply(added)
    eventually(lambda: total(8) and len(jobs()) == 3, 30, operator.told)
    back = threading.Event()
    expired = proxy.break_("GET", "watch=true", hold(back, watch_error(410, "Expired")), 3)
    assert proxy.cut_watches() >= 3
    eventually(lambda: expired.hits == 3, 10)
    before = jobs()
    fake_cluster.kubectl(
        *(
            "--namespace",
            namespace,
            "delete",
            "campaign/gone",
            "configuration/more",
            "--ignore-not-found",
        ),
        *(f"job/{name}" for name in before),
    )
    back.set()
    eventually(lambda: jobs() and not jobs().items() & before.items(), 15, operator.told)

    def known(kind: str) -> str:
        found = re.search(rf'robovast_objects{{kind="{kind}"}} (\d+)', page(port, "metrics"))
        return found[1] if found else ""

    eventually(lambda: known("Campaign") == known("Configuration") == known("Job") == "1", 15)
    made = created(fake_cluster, namespace, "jobs").total()
    time.sleep(3)
    assert created(fake_cluster, namespace, "jobs").total() == made, "Jobs come and go"


def test_every_busy_answer_is_waited_for_as_long_as_it_says(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    faults = [
        proxy.break_("POST", "/jobs", refuse(429, 2), 2),
        proxy.break_("PATCH", "/status", refuse(429, 2), 2),
        proxy.break_("GET", "/configmaps", refuse(429, 2), 2),
        proxy.break_("GET", "watch=true", refuse(429, 1), 3),
    ]
    operator = start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert [fault.times for fault in faults] == [0, 0, 0, 0]
    assert_right(fake_cluster, namespace)
    last: dict[tuple[str, str], float] = {}
    for moment, method, path, code in proxy.seen:
        if (method, path) in last and re.search("/jobs$|/status$|/configmaps$", path):
            assert moment - last.pop((method, path)) >= 1.9, (method, path)
        if code == 429:
            last[method, path] = moment


LOST: dict[str, tuple[str, str, Action, int]] = {
    "a Job's answer is cut off": ("POST", "/jobs", cut_answer, 2),
    "a Job's answer breaks off": ("POST", "/jobs", cut_in_the_middle, 2),
    "a Job is made, a time-out told": ("POST", "/jobs", fail_after(504), 2),
    "a plan's answer is cut off": ("POST", "/configmaps", cut_answer, 2),
    "a plan is made, an error told": ("POST", "/configmaps", fail_after(500), 2),
    "a status' answer is cut off": ("PATCH", "/status", cut_answer, 2),
    "a status is written, an error told": ("PATCH", "/status", fail_after(500), 1),
    "an event's answer breaks off": ("POST", "/events", cut_in_the_middle, 2),
    "the Lease's answer breaks off": ("PUT", "/leases", cut_in_the_middle, 2),
}


def test_writes_whose_answers_are_lost_make_nothing_twice(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    faults = [proxy.break_(*fault) for fault in LOST.values()]
    operator = start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    missed = [name for name, fault in zip(LOST, faults, strict=True) if not fault.hits]
    assert not missed
    assert_right(fake_cluster, namespace)
    told = ["EnoughRunsPassed", "Valid", "Planned", "JobCreated", "Finished", "Indexed"]
    assert events(fake_cluster, namespace) == Counter(told)


def events(cluster: Cluster, namespace: str) -> Counter[str]:
    """What Events tell of Campaigns, by reason."""
    about = "--field-selector=involvedObject.kind=Campaign"
    found = cluster.get("events", f"--namespace={namespace}", about)["items"]
    return Counter(item["reason"] for item in found)


def test_an_event_that_may_not_be_made_keeps_nothing_from_being_done(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    proxy.break_("POST", "/events", refuse(403))
    operator = start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert_right(fake_cluster, namespace)
    assert "no Event" in operator.told()


async def no_pods(request: web.Request, forward: Forward) -> Answer:
    """The pods are gone already."""
    return web.json_response({"kind": "PodList", "apiVersion": "v1", "items": []})


def test_last_words_that_are_gone_before_they_are_read_are_asked_for_again(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    """Each Job later than the one before, with another name."""
    lost = proxy.break_("GET", "/pods.*controller-uid", no_pods)
    operator = start()
    fake_cluster.apply(campaign("few", namespace, 3, 2))

    def finishes() -> list[str]:
        return [name for name in created(fake_cluster, namespace, "jobs") if "-finish-" in name]

    eventually(lambda: len(finishes()) == 3, told=operator.told)

    def told() -> bool:
        stalled = condition(status(fake_cluster, namespace, "few"), "Stalled")
        return (stalled["status"], stalled["reason"]) == ("True", "TaskPodsLost")

    eventually(told, 30, operator.told)
    assert lost.hits >= 3
    assert [name[-len("finish-1-2") :] for name in sorted(finishes())][-2:] == [
        "finish-1-1",
        "finish-1-2",
    ]
    proxy.mend()
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    state = status(fake_cluster, namespace, "few")
    assert (state["progress"], condition(state, "Stalled")["status"]) == ("6/6", "False")


def test_a_slow_server_makes_it_slow_and_nothing_else(
    fake_cluster: Cluster, namespace: str, proxy: FaultyApi, start: NewOperator
) -> None:
    for method in ("POST", "PATCH", "PUT"):
        proxy.break_(method, "", delay(1.5))
    operator = start(ROBOVAST_LEASE_SECONDS="15")
    fake_cluster.apply(campaign("few", namespace, 3, 2))
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert_right(fake_cluster, namespace)
    assert "cannot be renewed" not in operator.told()
