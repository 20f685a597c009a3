"""Secrets that a Campaign may name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from support.kube.fake_cluster import SCENARIO, SETTINGS, campaign

from robovast.kubeapi.crd import campaign_crd
from robovast.kubeapi.notice import Named, Notice, Order
from robovast.kubeapi.resources import Scheduling
from robovast.kubeapi.secret_names import SECRET_PREFIX
from robovast_operator.kube.objects import Object
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Accepted, Rejected
from robovast_operator.pods.templates import notify_pod
from robovast_operator.settings import OperatorSettings

FILES = {"scenario.osc": SCENARIO.encode()}
ALLOWING = OperatorSettings(agent_image="agent", endpoint="http://s3", secret_names=("payroll-db",))


def secrets_of(schema: Any, place: str = "") -> Iterator[tuple[str, Object]]:
    """The schemas of all fields that name a Secret, by their place."""
    if not isinstance(schema, dict):
        return
    words = ("secret", "urlfrom", "tokenfrom")
    is_name = schema.get("type") == "string" and place.endswith(("name", "Name"))
    if is_name and any(word in place.lower() for word in words):
        yield place, schema
    for name, child in (schema.get("properties") or {}).items():
        yield from secrets_of(child, f"{place}.{name}")
    yield from secrets_of(schema.get("items"), place)


def test_the_api_server_looks_at_every_name_of_a_secret() -> None:
    spec = campaign_crd()["spec"]["versions"][0]["schema"]["openAPIV3Schema"]["properties"]["spec"]
    found = dict(secrets_of(spec))
    assert len(found) >= 4
    for place, schema in found.items():
        rules = [rule["rule"] for rule in schema.get("x-kubernetes-validations", ())]
        assert any(SECRET_PREFIX in rule for rule in rules), place


@pytest.mark.parametrize(
    "spec",
    [
        {"source": {"git": {"url": "https://a/b", "ref": "main", "secretName": "payroll-db"}}},
        {"storage": {"secretName": "payroll-db"}},
        {"scheduling": {"imagePullSecrets": [{"name": "robovast-a"}, {"name": "payroll-db"}]}},
    ],
)
def test_what_was_stored_before_the_rule_gets_no_pods(spec: Object) -> None:
    refused = accept(campaign(**spec), FILES, SETTINGS)
    assert isinstance(refused, Rejected)
    assert refused.reason == "SecretNotAllowed"
    assert "`payroll-db`" in refused.message
    assert "begin with `robovast-`" in refused.message
    assert isinstance(accept(campaign(**spec), FILES, ALLOWING), Accepted)


def test_a_notification_brings_no_other_secret_into_a_pod_and_keeps_no_run_back() -> None:
    told = {
        "kind": "webhook",
        "url": "https://a/b",
        "tokenFrom": {"name": "payroll-db", "key": "k"},
    }
    made = accept(campaign(notifications=[told]), FILES, SETTINGS)
    assert isinstance(made, Accepted)
    about = Named(namespace="lab", name="drive", uid="1")
    notice = Notice(id="1", event="Finished", time="2026-11-21T07:00:00Z", campaign=about)
    order = Order(notice=notice, receivers=made.spec.notifications)
    pulled = Scheduling.model_validate({"imagePullSecrets": [{"name": "payroll-db"}]})
    assert "payroll-db" not in str(notify_pod(SETTINGS, pulled, order)["volumes"])
    assert "imagePullSecrets" not in notify_pod(SETTINGS, pulled, order)
    assert "payroll-db" in str(notify_pod(ALLOWING, pulled, order)["volumes"])
