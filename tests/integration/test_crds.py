"""What the API server makes of the resource definitions: refusals, columns, explanations."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
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
        *("wait", "--for=condition=Established", "--timeout=180s"),
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


NEWER = "v1beta1"
"""What the definitions know and do not serve yet."""


class Fresh:
    """A cluster by a kubectl that remembers nothing which others would go by later."""

    def __init__(self, server: Cluster, folder: Path) -> None:
        self._server, self._folder = server, folder

    def kubectl(self, *arguments: str, stdin: str | None = None) -> str:
        return self._server.kubectl(f"--cache-dir={self._folder}", *arguments, stdin=stdin)


def define(server: Fresh, change: Callable[[list[dict[str, Any]]], None]) -> None:
    """Apply the definition of Campaigns with other versions."""
    definition = yaml.safe_load((CRDS / "campaign.yaml").read_text())
    change(definition["spec"]["versions"])
    apply = ("apply", "--server-side", "--force-conflicts", "--filename=-")
    server.kubectl(*apply, stdin=json.dumps(definition))


def serves_newer(server: Fresh) -> bool:
    try:
        server.kubectl("get", f"--raw=/apis/robovast.io/{NEWER}/campaigns")
    except StartFailed:
        return False
    return True


@pytest.fixture
def both(server: Cluster, tmp_path: Path) -> Iterator[Fresh]:
    """The cluster as a later version of the chart makes it, which serves both versions."""
    fresh = Fresh(server, tmp_path)
    define(fresh, lambda versions: versions[1].update(served=True))
    eventually(lambda: serves_newer(fresh))
    yield fresh
    define(fresh, lambda versions: None)
    eventually(lambda: not serves_newer(fresh))


def read(server: Fresh, version: str, name: str) -> dict[str, Any]:
    """The Campaign as a client of one version sees it."""
    path = f"/apis/robovast.io/{version}/namespaces/default/campaigns/{name}"
    found: dict[str, Any] = json.loads(server.kubectl("get", f"--raw={path}"))
    assert found.pop("apiVersion") == f"robovast.io/{version}"
    return found


def tell(server: Fresh, name: str) -> None:
    """Write a status as the operator does."""
    metadata = {"name": name, "namespace": "default"}
    said = {"apiVersion": "robovast.io/v1alpha1", "kind": "Campaign", "metadata": metadata}
    server.kubectl(
        *("apply", "--server-side", "--force-conflicts", "--subresource=status"),
        *("--field-manager=robovast-operator", "--filename=-"),
        stdin=json.dumps({**said, "status": {"state": "Running"}}),
    )


@pytest.mark.parametrize(("one", "other"), [("v1alpha1", NEWER), (NEWER, "v1alpha1")])
def test_what_was_written_as_one_version_is_read_and_changed_as_the_other(
    both: Fresh, one: str, other: str
) -> None:
    """By `kubectl apply` of either kind, as from Git, and with the same rules."""
    name = f"as-{one}"
    made = {**campaign(name, "default", 2, 3), "apiVersion": f"robovast.io/{one}"}
    both.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    tell(both, name)
    assert read(both, one, name) == read(both, other, name)
    made = {**made, "apiVersion": f"robovast.io/{other}"}
    made["spec"] = {**made["spec"], "parallelism": 7}
    both.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    both.kubectl("apply", "--server-side", "--force-conflicts", "-f", "-", stdin=json.dumps(made))
    assert read(both, one, name)["spec"]["parallelism"] == 7
    made["spec"] = {**made["spec"], "image": "another"}
    with pytest.raises(StartFailed, match="`image` cannot be changed"):
        both.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    definition = json.loads(both.kubectl("get", "crd", "campaigns.robovast.io", "--output=json"))
    assert definition["status"]["storedVersions"] == ["v1alpha1"]


def test_a_rollback_to_a_chart_that_knows_both_goes_on_and_to_one_that_does_not_cannot(
    both: Fresh,
) -> None:
    """So both have to be known before the newer one is served."""
    made = {**campaign("later", "default", 2, 3), "apiVersion": f"robovast.io/{NEWER}"}
    both.kubectl("apply", "--server-side", "--filename=-", stdin=json.dumps(made))
    define(both, lambda versions: None)
    eventually(lambda: not serves_newer(both))
    tell(both, "later")
    assert read(both, "v1alpha1", "later")["status"] == {"state": "Running"}
    define(both, lambda versions: versions.pop() and None)

    def refused() -> str:
        try:
            tell(both, "later")
        except StartFailed as refusal:
            return str(refusal)
        return ""

    assert "invalid group/version" in eventually(refused)
    define(both, lambda versions: None)
    eventually(lambda: not refused())


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
