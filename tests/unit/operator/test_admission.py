"""Explanations of refusals by the ResourceQuotas and LimitRanges of a namespace."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast_operator.pods.admission import (
    OWN_CPU_LIMIT,
    NamespaceLimits,
    counts_jobs,
    explain,
    with_required_limits,
)
from robovast_operator.pods.own import OWN
from robovast_operator.pods.pod_status import memory_limit

AGENT = {"requests": {"cpu": "10m", "memory": "64Mi"}, "limits": {"memory": "512Mi"}}
RUN = {"requests": {"cpu": "100m", "memory": "128Mi"}, "limits": {"cpu": "100m", "memory": "128Mi"}}


def pod(agent: Any = AGENT, run: Any = RUN) -> dict[str, Any]:
    return {
        "initContainers": [{"name": "compat-version", "resources": agent}],
        "containers": [
            {"name": "agent", "resources": agent},
            {"name": "robovast", "resources": run},
        ],
    }


def job(spec: dict[str, Any]) -> dict[str, Any]:
    return {"metadata": {"name": "j"}, "spec": {"template": {"spec": spec}}}


def quota(**hard: str) -> NamespaceLimits:
    named = {key.replace("_", "."): value for key, value in hard.items()}
    return NamespaceLimits(quotas=[{"metadata": {"name": "q"}, "spec": {"hard": named}}])


def limit_range(**limits: Any) -> NamespaceLimits:
    item = {"type": "Container", **limits}
    return NamespaceLimits(ranges=[{"metadata": {"name": "r"}, "spec": {"limits": [item]}}])


def test_our_containers_get_a_cpu_limit_only_where_a_quota_requires_one() -> None:
    given_job = job(pod())
    made = with_required_limits(given_job, quota(limits_cpu="4"), OWN)["spec"]["template"]["spec"]
    limits = {
        c["name"]: c["resources"]["limits"] for c in [*made["initContainers"], *made["containers"]]
    }
    ours = {"cpu": OWN_CPU_LIMIT, "memory": "512Mi"}
    assert limits == {"compat-version": ours, "agent": ours, "robovast": RUN["limits"]}
    assert with_required_limits(given_job, quota(requests_cpu="4"), OWN) == given_job
    assert given_job == job(pod())


def test_a_cpu_limit_of_the_administrator_stays() -> None:
    agent = {"limits": {"cpu": "2"}}
    made = with_required_limits(job(pod(agent)), quota(limits_cpu="4"), OWN)
    assert made["spec"]["template"]["spec"]["containers"][0]["resources"]["limits"]["cpu"] == "2"


def test_a_missing_limit_is_explained_by_quota_field_container_and_remedy() -> None:
    message = (
        'Error creating: pods "a-0-x" is forbidden: failed quota: compute: must specify '
        "limits.cpu for: robovast; limits.memory for: agent,robovast"
    )
    why = explain(message, pod(), NamespaceLimits(), OWN)
    assert "ResourceQuota `compute` requires limits.cpu" in why
    assert "Set `cpu` in execution.resources of the .vast file" in why
    assert "`agent.resources.limits.memory` of the Helm chart" in why


def test_an_exceeded_quota_is_explained_by_its_numbers() -> None:
    message = (
        'jobs.batch "c-finish-1" is forbidden: exceeded quota: few, requested: count/jobs.batch=1, '
        "used: count/jobs.batch=1, limited: count/jobs.batch=1"
    )
    assert counts_jobs(message)
    why = explain(message, {}, NamespaceLimits())
    assert "ResourceQuota `few` allows 1 of count/jobs.batch: 1 are used, and 1 more" in why
    assert "Wait until other work finishes, or ask" in why
    assert not counts_jobs(message.replace("jobs.batch=", "secrets="))


@pytest.mark.parametrize("resource", ["configmaps", "count/configurations.robovast.io"])
def test_a_quota_of_objects_that_finished_campaigns_keep_is_no_reason_to_wait(
    resource: str,
) -> None:
    message = (
        f"exceeded quota: few, requested: {resource}=1, used: {resource}=4, limited: {resource}=4"
    )
    why = explain(message, {}, NamespaceLimits())
    assert "Remove finished Campaigns (`vast exec cluster run-cleanup`), or ask" in why
    assert f"raise spec.hard.{resource}." in why
    assert "Wait" not in why


@given(
    least=st.integers(1, 2000), asked=st.integers(1, 2000), most=st.integers(1, 4000),
    bound=st.integers(1, 4000), ratio=st.integers(1, 10),
)  # fmt: skip
def test_a_container_outside_of_a_limit_range_is_named_and_others_are_not(
    least: int, asked: int, most: int, bound: int, ratio: int
) -> None:
    run = {"requests": {"memory": f"{asked}Mi"}, "limits": {"memory": f"{bound}Mi"}}
    limits = limit_range(
        min={"memory": f"{least}Mi"},
        max={"memory": f"{most}Mi"},
        maxLimitRequestRatio={"memory": str(ratio)},
    )
    why = explain("is forbidden", {"containers": [{"name": "robovast", "resources": run}]}, limits)
    assert ("requires at least" in why) == (asked < least)
    assert ("for limits.memory, not" in why) == (bound > most)
    assert ("for the ratio" in why) == (bound > ratio * asked)
    assert (why == "") == (least <= asked and bound <= most and bound <= ratio * asked)


def test_a_limit_of_pods_counts_all_containers_with_their_defaults() -> None:
    pods = {"type": "Pod", "max": {"memory": "512Mi", "cpu": "1"}}
    containers: Any = {
        "type": "Container",
        "default": {"cpu": "600m"},
        "defaultRequest": {"cpu": "10m"},
    }
    found: Any = {"metadata": {"name": "bounds"}, "spec": {"limits": [pods, containers]}}
    why = explain("is forbidden", pod(), NamespaceLimits((), [found]), OWN)
    assert "LimitRange `bounds` allows at most 512Mi for limits.memory, not 640Mi (all" in why
    assert "Change `memory` in `resources` of the .vast file" in why
    assert "limits.cpu" not in why
    containers["default"]["cpu"] = "901m"
    why = explain("is forbidden", pod(), NamespaceLimits((), [found]), OWN)
    assert "allows at most 1 for limits.cpu, not 1.001 (all" in why
    containers["min"] = {"cpu": "20m"}
    why = explain("is forbidden", pod(run={}), NamespaceLimits((), [found]), OWN)
    assert "requires at least 20m for requests.cpu, not 10m (container `robovast`)" in why


def test_the_defaults_of_a_limit_range_count_before_its_bounds() -> None:
    bare = {"containers": [{"name": "robovast"}]}
    fine = limit_range(max={"cpu": "1"}, default={"cpu": "500m"}, min={"cpu": "100m"})
    assert explain("is forbidden", bare, fine) == ""
    strict = limit_range(max={"cpu": "1"})
    assert "LimitRange `r` allows at most 1 for limits.cpu, not no limit" in explain(
        "is forbidden", bare, strict
    )


@given(
    st.recursive(
        st.none() | st.text() | st.integers(),
        lambda x: (
            st.lists(x)
            | st.dictionaries(
                st.sampled_from(
                    ["spec", "limits", "hard", "type", "min", "max", "metadata", "name"]
                ),
                x,
            )
        ),
    )
)
def test_objects_of_any_shape_are_explained_without_an_exception(shape: Any) -> None:
    limits = NamespaceLimits(quotas=[{"spec": shape}], ranges=[{"spec": shape}])
    explain("is forbidden", pod(), limits, OWN)
    with_required_limits(job(pod()), limits, OWN)


def test_a_memory_limit_is_named_with_its_origin() -> None:
    def found(container: str, note: str = "", run: Any = RUN) -> str:
        annotations = {"kubernetes.io/limit-ranger": note}
        return memory_limit(
            {"metadata": {"annotations": annotations}, "spec": pod(run=run)}, container
        )

    assert found("robovast") == "the memory limit of 128Mi (set by `resources` in the .vast file)"
    assert "of 512Mi (set by `agent.resources`" in found("agent")
    limit = "cpu, memory limit for container robovast"
    note = f"LimitRanger plugin set: cpu request for container agent; {limit}"
    assert "LimitRange of the namespace" in found("robovast", note)
    assert "LimitRange" not in found("agent", note)
    assert "has no memory limit" in found("robovast", run={})
