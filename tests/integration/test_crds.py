"""What the API server makes of the resource definitions: refusals, columns, explanations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster
from support.kube.chart import of_kind, rendered
from support.kube.definitions import CRDS, await_definitions
from support.kube.operator_process import campaign
from support.patience import eventually

from robovast.kubeapi.names import CAMPAIGN_NAME_LIMIT
from robovast.kubeapi.resources import API_VERSION


@pytest.fixture(scope="module")
def server(control_plane: Cluster) -> Cluster:
    """A cluster that knows Campaigns, and one of them."""
    control_plane.kubectl("apply", "--server-side", "--force-conflicts", f"--filename={CRDS}")
    await_definitions(control_plane)
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
        ({"attempt": 3}, "can only be increased by one"),
        ({"image": "another"}, "`image` cannot be changed"),
        ({"storage": {"prefix": "other"}}, "`storage` cannot be changed"),
        ({"source": {"configMap": {"name": "x"}}}, "cannot be changed"),
        ({"parallelism": 0}, "parallelism"),
        ({"acceptance": {"minPassRatio": "2"}}, "minPassRatio"),
        ({"queueName": "Not A Name"}, "queueName"),
        ({"scheduling": {"nodeAffinity": {"required": [{"key": "zone"}]}}}, "need at least one"),
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


def tell(server: Cluster, name: str) -> None:
    """Write a status as the operator does."""
    metadata = {"name": name, "namespace": "default"}
    said = {"apiVersion": API_VERSION, "kind": "Campaign", "metadata": metadata}
    server.kubectl(
        *("apply", "--server-side", "--force-conflicts", "--subresource=status"),
        *("--field-manager=robovast-operator", "--filename=-"),
        stdin=json.dumps({**said, "status": {"state": "Running"}}),
    )


def test_a_field_that_leaves_git_leaves_the_object(server: Cluster) -> None:
    apply = ("apply", "--server-side", "--field-manager=tool", "--filename=-")
    made = campaign("from-git", "default", 2, 3)
    with_field = {**made, "spec": {**made["spec"], "queueName": "q"}}
    server.kubectl(*apply, stdin=json.dumps(with_field))
    server.kubectl(*apply, stdin=json.dumps(made))
    found: Any = server.get("campaign", "from-git")
    assert "queueName" not in found["spec"]


def test_an_object_is_listed_waited_for_edited_and_deleted(
    server: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "used"
    made = [campaign(name, "default", 2, 3, queueName=name), addition(name, name)]
    for obj in made:
        server.kubectl("apply", "-f", "-", stdin=json.dumps(obj))
    tell(server, name)
    for kind, selected in (("campaigns", "spec.queueName"), ("configurations", "spec.campaign")):
        chosen = ("get", kind, f"--field-selector={selected}={name}", "--no-headers")
        (line,) = server.kubectl(*chosen).splitlines()
        assert line.split()[0] == name
    chosen = ("get", "campaigns", "--field-selector=status.state=Running")
    assert name in server.kubectl(*chosen)
    campaigns, configurations = (f"{kind}/{name}" for kind in ("campaigns", "configurations"))
    state = "--for=jsonpath={.status.state}=Running"
    assert "condition met" in server.kubectl("wait", campaigns, state, "--timeout=20s")
    editor = tmp_path / "editor"
    editor.write_text("#!/bin/sh\nsed -i 's/runs: 2$/runs: 9/; s/queueName: .*/queueName: q/' $1\n")
    editor.chmod(0o755)
    monkeypatch.setenv("KUBE_EDITOR", str(editor))
    for one in (campaigns, configurations):
        assert "edited" in server.kubectl("edit", one)
    queue = server.kubectl("get", campaigns, "--output=jsonpath={.spec.queueName}")
    assert queue == "q"
    runs = server.kubectl("get", configurations, "--output=jsonpath={.spec.runs}")
    assert runs == "9"
    assert server.kubectl("delete", campaigns, configurations).count("deleted") == 2


def addition(name: str, campaign_name: str) -> dict[str, Any]:
    """A Configuration of a Campaign."""
    spec = {"campaign": campaign_name, "parameters": [{"x": 7}], "runs": 2}
    metadata = {"name": name, "namespace": "default"}
    return {"apiVersion": API_VERSION, "kind": "Configuration", "metadata": metadata, "spec": spec}


def test_a_configuration_stays_with_its_campaign(server: Cluster) -> None:
    made = addition("stays", "one")
    server.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    made["spec"]["campaign"] = "two"
    with pytest.raises(StartFailed, match="`campaign` cannot be changed"):
        server.kubectl("apply", "--filename=-", stdin=json.dumps(made))


def test_a_document_is_kept_as_its_user_wrote_it(server: Cluster) -> None:
    found: Any = server.get("campaign", "there")
    wanted = campaign("there", "default", 2, 3)["spec"]["vast"]
    assert found["spec"]["vast"] == wanted


def test_every_field_is_explained(server: Cluster) -> None:
    text = server.kubectl("explain", "campaign.spec", "--recursive")
    assert "minPassRatio" in text
    assert "runs_per_job" in text
    told = server.kubectl("explain", "campaign.spec.vast.execution.runs_per_job")
    assert "Number of runs that share one job" in told
    told = server.kubectl("explain", "campaign.status.failedRuns")
    assert "as ranges" in told


def test_the_table_says_what_a_person_asks(server: Cluster) -> None:
    table = server.kubectl("get", "campaigns")
    assert table.split("\n")[0].split() == [
        "NAME", "STATE", "PROGRESS", "ACTIVE", "WAITING",
        "PASSED", "FAILED", "ERRORED", "VERDICT", "AGE",
    ]  # fmt: skip
    assert table.split("\n")[0] == server.kubectl("get", "vcamp").split("\n")[0]
    assert "QUEUE" in server.kubectl("get", "campaigns", "--output=wide")
    made = addition("shown", "there")
    server.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    assert server.kubectl("get", "configurations").split("\n")[0].split() == [
        "NAME", "CAMPAIGN", "VARIANTS", "PROGRESS", "PASSED", "FAILED", "ERRORED", "AGE",
    ]  # fmt: skip
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
            eventually(lambda: not create(server, f"older-{number}", spec))  # noqa: B023
        other = {"storage": {"secretName": "other"}}
        assert "their names begin with" in create(server, "thief", other)
    finally:
        define(strict)
    eventually(lambda: create(server, "newer", SECRETS[0]))
    for number in range(len(SECRETS)):
        name = f"older-{number}"
        server.kubectl("patch", "campaign", name, "--type=merge", '-p={"spec":{"parallelism":3}}')
        status = '-p={"status":{"state":"Rejected"}}'
        server.kubectl("patch", "campaign", name, "--type=merge", "--subresource=status", status)
    change = '-p={"spec":{"scheduling":{"imagePullSecrets":[{"name":"another"}]}}}'
    with pytest.raises(StartFailed, match="their names begin with"):
        server.kubectl("patch", "campaign", "older-1", "--type=merge", change)


@given(name=st.from_regex(r"[a-z0-9]([-a-z0-9.]{0,60}[a-z0-9])?", fullmatch=True))
@settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))
def test_a_name_that_no_pod_can_have_is_refused_at_once_and_others_are_accepted(
    server: Cluster, name: str
) -> None:
    try:
        answer = create(server, name, {})
    finally:
        server.kubectl("delete", "campaign", name, "--ignore-not-found", "--wait=false")
    fits = len(name) <= CAMPAIGN_NAME_LIMIT and "." not in name
    if fits or "Invalid value" not in answer:
        assert fits == (answer == ""), answer
    else:
        assert "metadata.name: Invalid value" in answer


@pytest.mark.parametrize("image", [" a/b:1", "a/b :1", "a/b:1\t", ""])
def test_an_image_with_a_space_is_refused_by_its_field(server: Cluster, image: str) -> None:
    assert "spec.image: Invalid value" in create(server, "spaced", {"image": image})
    made = campaign("spaced", "default", 1, 1)
    made["spec"]["vast"]["execution"]["image"] = image
    answer = create(server, "spaced", made["spec"])
    assert "spec.vast.execution.image: Invalid value" in answer


@given(planned=st.integers(1, 40), runs=st.integers(1, 40))
@settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
def test_runs_below_the_planned_number_are_refused_with_that_number(
    server: Cluster, planned: int, runs: int
) -> None:
    name = f"planned-{planned}-{runs}"
    server.kubectl("apply", "-f", "-", stdin=json.dumps(campaign(name, "default", 1, planned)))
    try:
        status = json.dumps({"status": {"runsPerConfiguration": planned}})
        patch = ("patch", "campaign", name, "--type=merge")
        server.kubectl(*patch, "--subresource=status", f"--patch={status}")
        try:
            server.kubectl(*patch, f"--patch={json.dumps({'spec': {'runs': runs}})}")
            refusal = ""
        except StartFailed as error:
            refusal = str(error)
    finally:
        server.kubectl("delete", "campaign", name, "--wait=false")
    assert (refusal == "") == (runs >= planned), refusal
    if refusal:
        assert "spec.runs: Invalid value" in refusal
        assert "`status.runsPerConfiguration`" in refusal
