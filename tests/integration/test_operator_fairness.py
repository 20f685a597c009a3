"""No Campaign waits for the heavy `.vast` files of other namespaces."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any
from uuid import uuid4

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.chart import rendered
from support.kube.operator_process import (
    SYSTEM,
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    heavy,
    status,
)
from support.patience import eventually

SOON = 8.0
"""Time that the plans of large documents may keep the operator from a small Campaign [s]."""
SLOWER = 4
"""How many times as long it may take as with an operator that has nothing else to do."""


@pytest.fixture
def others(fake_cluster: Cluster) -> Iterator[str]:
    """The namespace of other users."""
    name = f"heavy-{uuid4().hex[:6]}"
    fake_cluster.kubectl("create", "namespace", name)
    yield name
    fake_cluster.kubectl("delete", "namespace", name, "--wait=false")


@pytest.fixture
def idle(fake_cluster: Cluster, new_operator: NewOperator) -> Iterator[tuple[str, OperatorProcess]]:
    """A namespace, and an operator for it that has nothing else to do."""
    name = f"idle-{uuid4().hex[:6]}"
    fake_cluster.kubectl("create", "namespace", name)
    account = {"kind": "ServiceAccount", "name": "robovast-operator", "namespace": SYSTEM}
    for obj in rendered(namespace=name):
        if obj["kind"] in {"Role", "RoleBinding"}:
            obj["metadata"]["namespace"] = name
            if obj["kind"] == "RoleBinding":
                obj["subjects"] = [account]
            fake_cluster.apply(obj)
    yield name, new_operator("idle", ROBOVAST_NAMESPACES=name, POD_NAMESPACE=name)
    fake_cluster.kubectl("delete", "namespace", name, "--wait=false")


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
    fake_cluster: Cluster,
    namespace: str,
    others: str,
    idle: tuple[str, OperatorProcess],
    new_operator: NewOperator,
) -> None:
    """An operator without other work is the measure, since tests in parallel load the machine."""
    quiet, measure = idle
    operator = new_operator(ROBOVAST_NAMESPACES=f"{namespace},{others}")
    operator.start()
    measure.start()
    seconds_until_accepted(fake_cluster, namespace, "first", operator)
    seconds_until_accepted(fake_cluster, quiet, "first", measure)
    names = [f"good-{n}" for n in range(3)] + [f"huge-{n}" for n in range(3)]
    for name in names:
        parameters = 3 if name.startswith("good") else 60
        fake_cluster.apply(heavy(name, others, 46, parameters))

    def times(name: str) -> tuple[float, float]:
        """The times of this operator, and of the one without other work."""
        return (
            seconds_until_accepted(fake_cluster, namespace, name, operator),
            seconds_until_accepted(fake_cluster, quiet, name, measure),
        )

    took = [times("small-0")]
    waiting = [name for name in names if not accepted(fake_cluster, others, name)]
    took += [times(f"small-{number}") for number in (1, 2)]
    own, usual = max(one for one, _ in took), max(one for _, one in took)
    assert own < SOON + SLOWER * usual, took
    assert waiting, "they were not heavy enough for this test"

    operator.kill()
    operator.start()
    eventually(lambda: operator.told().count("one leads") == 2, told=operator.told)
    again, usual = times("after-restart")
    assert again < 3 * SOON + SLOWER * usual, "a new leader expands all of them again"

    eventually(
        lambda: all(accepted(fake_cluster, others, name) for name in names), told=operator.told
    )


def test_configurations_that_are_heavy_delay_nobody_else_and_not_even_their_campaign(
    fake_cluster: Cluster,
    namespace: str,
    others: str,
    idle: tuple[str, OperatorProcess],
    new_operator: NewOperator,
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
                "apiVersion": "robovast.io/v1beta1",
                "kind": "Configuration",
                "metadata": {"name": name, "namespace": others},
                "spec": {"campaign": "base", "variations": entry},
            }
        )
    quiet, measure = idle
    measure.start()
    seconds_until_accepted(fake_cluster, quiet, "first", measure)
    own = seconds_until_accepted(fake_cluster, namespace, "small", operator)
    usual = seconds_until_accepted(fake_cluster, quiet, "small", measure)
    assert own < SOON + SLOWER * usual

    def told(name: str) -> tuple[str | None, ...]:
        found: Any = fake_cluster.get("configuration", name, f"--namespace={others}")
        state = condition(found.get("status") or {}, "Accepted")
        return state.get("status"), state.get("reason")

    eventually(lambda: told("tiny") == ("True", "Valid"), told=operator.told)
    eventually(
        lambda: all(told(f"huge-{n}")[0] in ("True", "False") for n in range(3)),
        told=operator.told,
    )
