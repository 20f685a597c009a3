"""An Event explains a stall only if nothing has gone well since then."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast_operator.kube.times import format_time
from robovast_operator.kube.untrusted_fields import shaped
from robovast_operator.pods.own import CONTAINERS_ANNOTATION
from robovast_operator.pods.pod_events import hook_trouble, last_success, trouble_of_events

START = datetime(2026, 11, 21, 8, tzinfo=UTC)
CAUSES = ["FailedMount", "FailedCreatePodSandBox", "FailedCreate"]
STEPS = ["Scheduled", "Pulled", "Created", "Started", "SuccessfulCreate"]
OTHERS = ["BackOff", "Pulling", "SandboxChanged", "Unhealthy"]
SECONDS = st.integers(0, 20)


def at(seconds: int) -> str:
    return format_time(START + timedelta(seconds=seconds))


def event(reason: str, seconds: int, message: str = "", place: str = "", how: int = 0) -> Any:
    """An Event as the kubelet, the scheduler or another client of events.k8s.io writes it."""
    times = (
        {"firstTimestamp": at(0), "lastTimestamp": at(seconds)},
        {"lastTimestamp": None, "eventTime": at(seconds)},
        {"lastTimestamp": None, "eventTime": at(0), "series": {"lastObservedTime": at(seconds)}},
    )
    about = {"fieldPath": place} if place else {}
    return {"reason": reason, "message": message, "involvedObject": about, **times[how]}


def pod(successes: dict[str, int], own: str = "compat-version robovast agent") -> Any:
    """A pod that waits, in which something went well at some times."""
    status: dict[str, Any] = {"phase": "Pending", "conditions": [], "initContainerStatuses": []}
    for kind, seconds in successes.items():
        when = at(seconds)
        if kind in {"PodScheduled", "PodReadyToStartContainers", "Initialized"}:
            made = {"type": kind, "status": "True", "lastTransitionTime": when}
            status["conditions"].append(made)
        elif kind != "created":
            ended = {"exitCode": 0, "finishedAt": when}
            states = {"runs": {"running": {"startedAt": when}}, "ended": {"terminated": ended}}
            made = {"name": kind, "image": "i", "state": states[kind]}
            status["initContainerStatuses"].append(made)
    bad = {"type": "DisruptionTarget", "status": "True", "lastTransitionTime": at(99)}
    unready = {"type": "Ready", "status": "False", "lastTransitionTime": at(99)}
    status["conditions"] += [bad, unready]
    failed = {"exitCode": 1, "finishedAt": at(99), "startedAt": at(0)}
    status["containerStatuses"] = [{"name": "x", "image": "i", "state": {"terminated": failed}}]
    meta = {"name": "p", "creationTimestamp": at(successes.get("created", 0))}
    return shaped(
        {"metadata": {**meta, "annotations": {CONTAINERS_ANNOTATION: own}}, "status": status}
    )


SUCCESSES = st.dictionaries(
    st.sampled_from(
        ["created", "PodScheduled", "PodReadyToStartContainers", "Initialized", "runs", "ended"]
    ),
    SECONDS,
)


@given(
    st.lists(st.tuples(st.sampled_from([*CAUSES, *STEPS, *OTHERS]), SECONDS, st.integers(0, 2))),
    SUCCESSES,
)
def test_an_event_explains_only_what_came_after_the_last_success(
    told: list[tuple[str, int, int]], successes: dict[str, int]
) -> None:
    """In whatever order the API server lists Events, and whoever writes them."""
    events = [event(reason, sec, f"{reason} at {sec}", how=how) for reason, sec, how in told]
    good = max([0, *successes.values(), *(sec for reason, sec, _ in told if reason in STEPS)])
    bad = max([0, *(sec for reason, sec, _ in told if reason in CAUSES)])
    found = trouble_of_events(events, last_success(pod(successes)))
    if bad <= good:
        assert found is None
    else:
        assert found is not None
        assert any(f": {reason} at {bad}. " in found.message for reason in CAUSES)


@given(st.lists(SUCCESSES, max_size=3), SECONDS)
def test_a_refusal_is_over_when_a_pod_of_the_job_came_later(
    pods: list[dict[str, int]], since: int
) -> None:
    well = last_success(*map(pod, pods), since=at(since))
    seconds = max([since, *(sec for each in pods for sec in each.values())])
    assert well == START + timedelta(seconds=seconds)
    assert trouble_of_events([event("FailedCreate", seconds)], well) is None
    assert trouble_of_events([event("FailedCreate", seconds + 1)], well) is not None


@pytest.mark.parametrize(
    ("reason", "message", "told"),
    [
        ("FailedMount", 'secret "nowhere" not found', "ContainerConfigError"),
        ("FailedCreatePodSandBox", "no network", "ContainerError"),
        ("FailedCreate", "exceeded quota: small", "QuotaExceeded"),
        ("FailedCreate", "violates PodSecurity", "RequestDenied"),
    ],
)
def test_what_only_events_tell_is_told(reason: str, message: str, told: str) -> None:
    found = trouble_of_events([event("BackOff", 9), event(reason, 5, message)], START)
    assert found is not None
    assert found.reason == told
    assert f": {message}. " in found.message
    assert trouble_of_events([event("BackOff", 9)], START) is None


NAMES = ["compat-version", "mesh", "robovast", "agent"]


@given(
    st.permutations(NAMES[1:]),
    st.integers(0, 2),
    st.sampled_from(["Pulling", "Pulled", "Started", ""]),
    st.sampled_from(["", "lifecycle", "ready", "terminated"]),
    st.randoms(),
)
def test_a_hook_that_holds_a_pod_is_told(
    order: list[str], number: int, last: str, but: str, chance: Any
) -> None:
    """Of the containers that start in turn, one has started and the next has not begun."""
    held = pod({}, own="compat-version robovast agent")
    hook = {} if but == "lifecycle" else {"lifecycle": {"postStart": {"exec": {}}}}
    specs = [{"name": name, **(hook if n == number else {})} for n, name in enumerate(order)]
    held["spec"] = {"initContainers": [{"name": NAMES[0]}], "containers": specs}
    waits = {"waiting": {"reason": "PodInitializing"}}
    states = [{"name": name, "image": "i", "ready": False, "state": waits} for name in order]
    if but == "ready":
        states[number]["ready"] = True
    if but == "terminated":
        states[number]["state"] = {"terminated": {"exitCode": 1}}
    held["status"]["containerStatuses"] = states
    begun = [(NAMES[0], "Started"), *((name, "Started") for name in order[:number])]
    told = [event("FailedMount", 20), *(event(r, 1, place=f"spec.x{{{n}}}") for n, r in begun)]
    if last:
        told.append(event(last, 2, place=f"spec.containers{{{order[number]}}}"))
    chance.shuffle(told)
    found = hook_trouble(held, told)
    if last != "Started" or but:
        assert found is None
        return
    assert found is not None
    assert found.reason == ("ForeignContainer" if order[number] == "mesh" else "ContainerError")
    assert re.match(f"(The c|C)ontainer {order[number]} in (the )?pod p", found.message)
    assert "`postStart` hook" in found.message
    for later in order[number + 1 :]:
        begins = [*told, event("Pulling", 2, place=f"spec.containers{{{later}}}")]
        assert hook_trouble(held, begins) is None, "the hook is over"
