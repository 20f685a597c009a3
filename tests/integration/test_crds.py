"""What the API server makes of the resource definitions: refusals, columns, explanations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster
from support.kube.chart import of_kind, rendered
from support.kube.operator_process import campaign
from support.patience import eventually

CRDS = Path(__file__).parents[2] / "crds"


@pytest.fixture(scope="module")
def server(control_plane: Cluster) -> Cluster:
    """A cluster that knows Campaigns, and one of them."""
    control_plane.kubectl("apply", "--server-side", "--force-conflicts", f"--filename={CRDS}")
    control_plane.kubectl(
        *("wait", "--for=condition=Established", "--timeout=20s"),
        *("crd/campaigns.robovast.io", "crd/configurations.robovast.io"),
    )
    made = campaign("there", "default", 2, 3)
    made["spec"] |= {"runs": 3, "attempt": 1}
    control_plane.kubectl("create", "--filename=-", stdin=json.dumps(made))
    return control_plane


def change(server: Cluster, spec: dict[str, Any]) -> str:
    """What is said to a change of the Campaign; empty when it is taken."""
    patch = json.dumps({"spec": spec})
    try:
        server.kubectl("patch", "campaign", "there", "--type=merge", f"--patch={patch}")
    except StartFailed as refusal:
        return str(refusal)
    return ""


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ({"runs": 2}, "can only be raised"),
        ({"attempt": 3}, "by one at a time"),
        ({"image": "another"}, "`image` cannot be changed"),
        ({"storage": {"prefix": "other"}}, "`storage` cannot be changed"),
        ({"source": {"configMap": {"name": "x"}}}, "cannot be changed"),
        ({"parallelism": 0}, "parallelism"),
        ({"acceptance": {"minPassRatio": "2"}}, "minPassRatio"),
        ({"queueName": "Not A Name"}, "queueName"),
        ({"scheduling": {"nodeAffinity": {"required": [{"key": "zone"}]}}}, "need some"),
        ({"scheduling": {"nodeAffinity": {"preferred": [{"key": "a b", "values": ["c"]}]}}}, "key"),
    ],
)
def test_a_change_that_cannot_be_is_refused_with_its_reason(
    server: Cluster, spec: dict[str, Any], said: str
) -> None:
    assert said in change(server, spec)


@pytest.mark.parametrize(
    "spec",
    [
        {"runs": 5},
        {"suspend": True},
        {"parallelism": 7},
        {"attempt": 2},
        {"scheduling": {"nodeAffinity": {"preferred": [{"key": "fast", "operator": "Exists"}]}}},
    ],
)
def test_what_may_change_does(server: Cluster, spec: dict[str, Any]) -> None:
    assert change(server, spec) == ""


def test_a_document_is_kept_as_its_user_wrote_it(server: Cluster) -> None:
    found: Any = server.get("campaign", "there")
    wanted = campaign("there", "default", 2, 3)["spec"]["vast"]
    assert found["spec"]["vast"] == wanted


def test_every_field_is_explained(server: Cluster) -> None:
    text = server.kubectl("explain", "campaign.spec", "--recursive")
    assert "minPassRatio" in text
    assert "runs_per_job" in text
    told = server.kubectl("explain", "campaign.spec.vast.execution.runs_per_job")
    assert "How many runs share one job" in told
    told = server.kubectl("explain", "campaign.status.failedRuns")
    assert "as ranges" in told


def test_the_table_says_what_a_person_asks(server: Cluster) -> None:
    table = server.kubectl("get", "vcamp")
    assert table.split("\n")[0].split() == [
        "NAME", "STATE", "PROGRESS", "ACTIVE", "WAITING",
        "PASSED", "FAILED", "ERRORED", "VERDICT", "AGE",
    ]  # fmt: skip
    assert "QUEUE" in server.kubectl("get", "campaigns", "--output=wide")
    assert "there" in server.kubectl("get", "robovast", "--output=name")
    selected = ("get", "campaigns", "--output=name", "--field-selector")
    assert "there" not in server.kubectl(*selected, "spec.queueName=none")


def test_an_unknown_key_is_refused_not_dropped(server: Cluster) -> None:
    wrong = campaign("wrong", "default", 1, 1)
    wrong["spec"]["vast"]["execution"]["runz"] = 3
    with pytest.raises(StartFailed, match="runz"):
        server.kubectl("create", "--filename=-", stdin=json.dumps(wrong))


SECRETS = [
    {"storage": {"secretName": "payroll-db"}},
    {"scheduling": {"imagePullSecrets": [{"name": "payroll-db"}]}},
    {"notifications": [{"kind": "ntfy", "urlFrom": {"name": "payroll-db", "key": "url"}}]},
    {
        "notifications": [
            {"kind": "webhook", "url": "https://a", "tokenFrom": {"name": "payroll-db", "key": "k"}}
        ]
    },
]


def create(server: Cluster, name: str, spec: dict[str, Any]) -> str:
    """What is said to a new Campaign; empty when it is taken."""
    made = campaign(name, "default", 1, 1)
    made["spec"] |= spec
    try:
        server.kubectl("create", "--filename=-", stdin=json.dumps(made))
    except StartFailed as refusal:
        return str(refusal)
    return ""


@pytest.mark.parametrize("spec", SECRETS)
def test_a_secret_that_was_not_made_for_campaigns_is_refused_with_the_remedy(
    server: Cluster, spec: dict[str, Any]
) -> None:
    told = create(server, "thief", spec)
    assert "their names begin with `robovast-`" in told
    assert "policies.secretNames" in told


def definition(values: dict[str, Any]) -> dict[str, Any]:
    """The definition of Campaigns as the chart installs it."""
    return of_kind(rendered(values), "CustomResourceDefinition")["campaigns.robovast.io"]


def test_an_administrator_can_allow_secrets_by_name_and_what_is_stored_stays_changeable(
    server: Cluster,
) -> None:
    allowing = definition({"policies": {"secretNames": ["payroll-db", "registry"]}})
    strict = definition({})

    def define(wanted: dict[str, Any]) -> None:
        apply = ("apply", "--server-side", "--force-conflicts", "--filename=-")
        server.kubectl(*apply, stdin=json.dumps(wanted))

    define(allowing)
    try:
        for number, spec in enumerate(SECRETS):
            eventually(lambda: not create(server, f"older-{number}", spec), 20)  # noqa: B023
        other = {"storage": {"secretName": "other"}}
        assert "their names begin with" in create(server, "thief", other)
    finally:
        define(strict)
    eventually(lambda: create(server, "newer", SECRETS[0]), 20)
    for number in range(len(SECRETS)):
        name = f"older-{number}"
        server.kubectl("patch", "campaign", name, "--type=merge", '-p={"spec":{"parallelism":3}}')
        status = '-p={"status":{"state":"Rejected"}}'
        server.kubectl("patch", "campaign", name, "--type=merge", "--subresource=status", status)
    change = '-p={"spec":{"scheduling":{"imagePullSecrets":[{"name":"another"}]}}}'
    with pytest.raises(StartFailed, match="their names begin with"):
        server.kubectl("patch", "campaign", "older-1", "--type=merge", change)
