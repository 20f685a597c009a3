"""No Campaign waits for the heavy `.vast` files of other namespaces."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any
from uuid import uuid4

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    status,
)
from support.patience import eventually

SOON = 5.0
"""Time in which a small Campaign is accepted, also on a machine that other tests load [s]."""


@pytest.fixture
def others(fake_cluster: Cluster) -> Iterator[str]:
    """The namespace of other users."""
    name = f"heavy-{uuid4().hex[:6]}"
    fake_cluster.kubectl("create", "namespace", name)
    yield name
    fake_cluster.kubectl("delete", "namespace", name, "--wait=false")


def heavy(name: str, namespace: str, values: int, parameters: int) -> dict[str, Any]:
    """A Campaign with `values ** 3` variants, each of so many parameters."""
    obj = campaign(name, namespace, 1, 1, suspend=True)
    names = [f"p{number}" for number in range(parameters)]
    obj["spec"]["vast"]["configuration"] = [
        {
            "name": "one",
            "variations": [
                {"ParameterVariationList": {"name": name, "values": list(range(values))}}
                for name in names[:3]
            ],
        }
    ]
    declared = "".join(f'    {name}: string = "{"x" * 50}"\n' for name in names)
    scenario = f"scenario try_it:\n{declared}    do serial:\n        wait elapsed(1s)\n"
    obj["spec"]["source"]["inline"]["files"]["scenario.osc"] = scenario
    return obj


def accepted(cluster: Cluster, namespace: str, name: str) -> dict[str, str]:
    return condition(status(cluster, namespace, name), "Accepted")


def seconds_until_accepted(
    cluster: Cluster, namespace: str, name: str, operator: OperatorProcess
) -> float:
    """Apply a small Campaign and wait for it."""
    begun = time.monotonic()
    cluster.apply(campaign(name, namespace, 3, 1, suspend=True))
    eventually(
        lambda: accepted(cluster, namespace, name).get("status") == "True", told=operator.told
    )
    return time.monotonic() - begun


def test_a_small_campaign_waits_for_no_heavy_one_of_another_namespace(
    fake_cluster: Cluster, namespace: str, others: str, new_operator: NewOperator
) -> None:
    operator = new_operator(ROBOVAST_NAMESPACES=f"{namespace},{others}")
    operator.start()
    idle = seconds_until_accepted(fake_cluster, namespace, "idle", operator)
    names = [f"good-{n}" for n in range(3)] + [f"huge-{n}" for n in range(3)]
    for name in names:
        parameters = 3 if name.startswith("good") else 60
        fake_cluster.apply(heavy(name, others, 46, parameters))
    took = [
        seconds_until_accepted(fake_cluster, namespace, f"small-{number}", operator)
        for number in range(3)
    ]
    waiting = [name for name in names if not accepted(fake_cluster, others, name)]
    assert max(took) < SOON, (idle, took)
    assert waiting, "they were not heavy enough for this test"

    operator.kill()
    operator.start()
    again = seconds_until_accepted(fake_cluster, namespace, "after-restart", operator)
    assert again < SOON + 15, "a new leader waits until the former one's lease has ended"

    eventually(
        lambda: all(accepted(fake_cluster, others, name) for name in names), told=operator.told
    )


def test_configurations_that_are_heavy_delay_nobody_else_and_not_even_their_campaign(
    fake_cluster: Cluster, namespace: str, others: str, new_operator: NewOperator
) -> None:
    operator = new_operator(ROBOVAST_NAMESPACES=f"{namespace},{others}")
    operator.start()
    base = heavy("base", others, 1, 60)
    fake_cluster.apply(base)
    eventually(lambda: accepted(fake_cluster, others, "base").get("status") == "True")
    variations = heavy("huge", others, 46, 60)["spec"]["vast"]["configuration"][0]["variations"]
    for name, entry in [(f"huge-{n}", variations) for n in range(3)] + [
        ("tiny", [{"ParameterVariationList": {"name": "p0", "values": ["a", "b"]}}])
    ]:
        fake_cluster.apply(
            {
                "apiVersion": "robovast.io/v1alpha1",
                "kind": "Configuration",
                "metadata": {"name": name, "namespace": others},
                "spec": {"campaign": "base", "variations": entry},
            }
        )
    assert seconds_until_accepted(fake_cluster, namespace, "small", operator) < SOON

    def told(name: str) -> tuple[str | None, ...]:
        found: Any = fake_cluster.get("configuration", name, f"--namespace={others}")
        state = condition(found.get("status") or {}, "Accepted")
        return state.get("status"), state.get("reason")

    eventually(lambda: told("tiny") == ("True", "Valid"), told=operator.told)
    eventually(
        lambda: all(told(f"huge-{n}")[0] in ("True", "False") for n in range(3)),
        told=operator.told,
    )
