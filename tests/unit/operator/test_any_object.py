"""Whatever stands in any object that others can write: it is nobody else's trouble."""

from __future__ import annotations

import asyncio
import copy
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kube.fake_cluster import SETTINGS, accepted, campaign

from robovast.base.errors import InputError
from robovast.model.packs import Block, PlanSpec
from robovast_operator import operator as operator_module
from robovast_operator.effects import inputs as inputs_module
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.objects import Object
from robovast_operator.operator import Operator
from robovast_operator.planning.campaign import Revision
from robovast_operator.planning.shards import first_attempts
from robovast_operator.pods.jobs import campaign_plan, plan_config_map, shard_job, task_job

anything = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=12)
    | st.sampled_from(["0-99999999999", "5-3", "x", "9" * 5000, "2026-13-01", "1", -1, 10**30]),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=12), inner, max_size=3)
    ),
    max_leaves=6,
)

UID = "0123-4567"


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every value below."""
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    return [path, *(place for key, item in items for place in places(item, (*path, key)))]


def changed(obj: Object, path: tuple[Any, ...], value: Any) -> Any:
    """A copy of an object with another value at one place."""
    made = copy.deepcopy(obj)
    if not path:
        return value
    at = made
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return made


def _meta(name: str, **more: Any) -> Object:
    return {
        "namespace": "lab",
        "name": name,
        "uid": f"uid-{name}",
        "resourceVersion": "7",
        "creationTimestamp": "2026-11-21T07:00:00Z",
        "generation": 1,
        **more,
    }


def _condition(name: str, truth: str, reason: str = "Why") -> Object:
    return {
        "type": name,
        "status": truth,
        "reason": reason,
        "message": "m",
        "lastTransitionTime": "2026-11-21T07:30:00Z",
    }


def _campaign() -> Object:
    obj = campaign(attempt=1, notifications=[{"kind": "ntfy", "url": "https://x.test/t"}])
    obj["status"] = {
        "observedGeneration": 1,
        "state": "Running",
        "attempt": 1,
        "runs": {"total": 3, "passed": 1},
        "failedRuns": "1",
        "erroredRuns": "2",
        "failing": ["hall-1/0"],
        "shards": [
            {"index": 0, "job": "drive-0123-0", "state": "Open", "packs": "0-2", "plan": "p"}
        ],
        "finishedShards": 0,
        "startTime": "2026-11-21T07:10:00Z",
        "notified": ["stalled-1-Why"],
        "conditions": [_condition("Succeeded", "Unknown"), _condition("Stalled", "True")],
    }
    return obj


def _configuration() -> Object:
    spec = {"campaign": "drive", "name": "more", "parameters": [{"speed": 2.0}], "runs": 2}
    return {"metadata": _meta("more"), "spec": spec, "status": {"observedGeneration": 0}}


def _jobs() -> list[Object]:
    made = accepted()
    plan = PlanSpec(blocks=(Block(first_variant=0, variants=3, runs=1),))
    name = made.identity.child("plan-0")
    revision = Revision(0, name, plan, made.entries, {}, made.document_text)
    (shard,) = first_attempts(made.identity, [revision])
    jobs = [
        shard_job(made, SETTINGS, shard),
        task_job(made, SETTINGS, "finish", made.identity.child("finish-1"), name),
    ]
    for job in jobs:
        job["metadata"] |= _meta(job["metadata"]["name"])
        job["status"] = {
            "active": 1,
            "ready": 0,
            "failed": 1,
            "completedIndexes": "0",
            "failedIndexes": "1",
            "startTime": "2026-11-21T07:10:00Z",
            "conditions": [_condition("Failed", "True", "FailedIndexes")],
        }
    return jobs


def _plan() -> Object:
    made = accepted()
    plan = PlanSpec(blocks=(Block(first_variant=0, variants=3, runs=1),))
    obj = plan_config_map(
        made, made.identity.child("plan-0"), campaign_plan(made, plan, made.entries)
    )
    return {**obj, "metadata": {**obj["metadata"], **_meta(obj["metadata"]["name"])}}


def _pod() -> Object:
    ended = {"exitCode": 10, "message": '{"passed": "", "failed": "1", "errored": ""}'}
    waiting = {"reason": "ErrImagePull", "message": "no such image"}
    annotations = {"batch.kubernetes.io/job-completion-index": "1"}
    return {
        "metadata": _meta("pod", annotations=annotations, finalizers=["x"]),
        "spec": {"containers": []},
        "status": {
            "phase": "Failed",
            "conditions": [_condition("PodScheduled", "False")],
            "containerStatuses": [
                {"name": "agent", "image": "a", "state": {"terminated": ended}},
                {"name": "finish", "image": "a", "state": {"terminated": ended}},
                {
                    "name": "robovast",
                    "image": "a",
                    "imageID": "docker-pullable://a@sha256:" + "a" * 64,
                    "state": {"waiting": waiting},
                },
            ],
        },
    }


def _workload() -> Object:
    return {
        "metadata": _meta("w", annotations={"robovast.io/parked": "true"}),
        "spec": {"active": True, "podSets": [{"count": 3}]},
        "status": {"conditions": [_condition("QuotaReserved", "False", "Pending")]},
    }


KINDS: dict[str, Callable[[], Object]] = {
    "campaigns": _campaign,
    "configurations": _configuration,
    "jobs": lambda: _jobs()[0],
    "finish": lambda: _jobs()[1],
    "configmaps": _plan,
    "pods": _pod,
    "workloads": _workload,
}
PLACES = [(kind, path) for kind, make in KINDS.items() for path in places(make())]


class Server(Api):
    """An API server with a few objects, that takes everything and answers nothing else."""

    def __init__(self, *_: Any, **__: Any) -> None:
        super().__init__(None)
        self.objects: dict[str, list[Any]] = {}
        self.made: list[Object] = []
        self.statuses: dict[str, Object] = {}

    async def _request(
        self,
        method: str,
        path: str,
        *,
        body: Object | None = None,
        kind: str = "application/json",
        query: Mapping[str, str] | None = None,
        tries: int = 5,
    ) -> Object:
        del kind, query, tries
        if method == "GET":
            collection = path.rpartition("/")[2]
            return {"items": copy.deepcopy(self.objects.get(collection, []))}
        if body is None:
            raise ApiError(404, "NotFound", path)
        if path.endswith("/status"):
            self.statuses[body["metadata"]["name"]] = body["status"]
            raise ApiError(404, "NotFound", path)
        made = copy.deepcopy(body)
        made.setdefault("metadata", {}).update(_meta(body.get("metadata", {}).get("name", "x")))
        self.made.append(made)
        self.objects.setdefault(path.rpartition("/")[2], []).append(made)
        return copy.deepcopy(made)


class Here:
    """Calls functions in this process, where hundreds of examples can be afforded."""

    def submit(self, who: tuple[str, ...], function: Callable[..., Any], *args: Any) -> Any:
        assert who
        future = asyncio.get_running_loop().create_future()
        try:
            future.set_result(function(*args))
        except InputError as error:
            future.set_exception(error)
        return future


@contextmanager
def no_fault() -> Iterator[None]:
    """Nothing is logged that has a traceback."""
    seen: list[logging.LogRecord] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = seen.append  # type: ignore[method-assign]
    logging.getLogger("robovast_operator").addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger("robovast_operator").removeHandler(handler)
    assert not seen, [record.exc_info for record in seen]


def neighbour() -> Object:
    """A Campaign in good shape beside the others."""
    obj = campaign()
    obj["metadata"] |= {"name": "good", "uid": "good-uid"}
    return obj


async def look(objects: dict[str, list[Any]]) -> Server:
    """What the operator does with what is there."""
    with (
        patch.object(operator_module, "Api", Server),
        patch.object(operator_module, "connect", lambda: None),
        patch.object(inputs_module, "Apart", Here),
    ):
        operator = Operator(SETTINGS)
    server = operator.api
    assert isinstance(server, Server)
    server.objects = objects
    resync = operator._resync
    for _ in range(2):
        await resync.compare()
    for name in ("campaign", "configuration", "job"):
        for obj in objects[f"{name}s"]:
            getattr(operator, f"{name}_event")("MODIFIED", copy.deepcopy(obj))
    for _ in range(3):  # expanded, planned, looked at again
        for key in (*operator.store.campaigns, ("lab", "nobody")):
            memory = operator._reconcile._memories.get(key)
            if memory is not None:  # long enough for a look at pods and queues
                memory.pods.motion.moved -= 1000
            await operator._reconcile(key)
    await resync.compare()
    operator.metrics.page(operator.store, operator.queue, leading=True)
    for name in ("campaign", "configuration", "job"):
        for obj in objects[f"{name}s"]:
            getattr(operator, f"{name}_event")("DELETED", copy.deepcopy(obj))
    return server


def cluster(kind: str, obj: Any) -> dict[str, list[Any]]:
    """One object of each kind, one of them as given, and a Campaign in good shape."""
    found = {name: make() for name, make in KINDS.items()} | {kind: obj}
    return {
        "campaigns": [found["campaigns"], neighbour()],
        "configurations": [found["configurations"]],
        "jobs": [found["jobs"], found["finish"]],
        "configmaps": [found["configmaps"]],
        "pods": [found["pods"]],
        "workloads": [found["workloads"]],
    }


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(PLACES), anything)
def test_any_value_anywhere_harms_nobody_else(
    place: tuple[str, tuple[Any, ...]], value: Any
) -> None:
    kind, path = place
    objects = cluster(kind, changed(KINDS[kind](), path, value))
    with no_fault():
        server = asyncio.run(look(objects))
    made = {obj["metadata"]["name"] for obj in server.made if obj.get("kind") == "Job"}
    assert "good-good-0" in made


@pytest.mark.parametrize("value", ["x", "9" * 5000, "-1", ""])
def test_a_label_that_makes_no_sense_stops_nothing(value: str) -> None:
    job = KINDS["jobs"]()
    job["metadata"]["labels"]["robovast.io/shard"] = value
    job["metadata"]["annotations"]["robovast.io/attempt"] = value
    with no_fault():
        server = asyncio.run(look(cluster("jobs", job)))
    assert any(obj["metadata"]["name"] == "good-good-0" for obj in server.made)
