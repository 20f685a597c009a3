"""What the API server makes of the resource definitions: refusals, columns, explanations."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster
from support.kube.chart import of_kind, rendered
from support.kube.definitions import (
    CRDS,
    NEWER,
    OLDER,
    VERSIONS,
    Redefined,
    as_version,
    await_definitions,
    now,
    of_chart_0_1_0,
    of_one_version,
    read,
    redefined,
)
from support.kube.operator_process import campaign
from support.patience import eventually

from robovast.kubeapi.names import CAMPAIGN_NAME_LIMIT


@pytest.fixture(scope="module")
def server(control_plane: Cluster) -> Cluster:
    """A cluster that knows Campaigns, and one of them."""
    control_plane.kubectl("apply", "--server-side", "--force-conflicts", f"--filename={CRDS}")
    await_definitions(control_plane)
    made = campaign("there", "default", 2, 3)
    made["spec"] |= {"runs": 3, "attempt": 1}
    control_plane.kubectl("create", "--filename=-", stdin=json.dumps(made))
    return control_plane


def change(server: Cluster, version: str, spec: dict[str, Any]) -> str:
    """What is said to a change of the Campaign in a version; empty when it is taken."""
    patch, kind = json.dumps({"spec": spec}), f"campaigns.{version}.robovast.io"
    try:
        server.kubectl("patch", kind, "there", "--type=merge", f"--patch={patch}")
    except StartFailed as refusal:
        return str(refusal)
    return ""


@pytest.mark.parametrize("version", VERSIONS)
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
    server: Cluster, version: str, spec: dict[str, Any], said: str
) -> None:
    assert said in change(server, version, spec)


@pytest.mark.parametrize("version", VERSIONS)
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
def test_what_may_change_does(server: Cluster, version: str, spec: dict[str, Any]) -> None:
    assert change(server, version, spec) == ""


@pytest.fixture
def redefinable(server: Cluster, tmp_path: Path) -> Iterator[Redefined]:
    """The cluster as this chart makes it, and in the end again."""
    with redefined(server, tmp_path) as made:
        yield made


def tell(server: Cluster, name: str) -> None:
    """Write a status as the operator does."""
    metadata = {"name": name, "namespace": "default"}
    said = {"apiVersion": f"robovast.io/{OLDER}", "kind": "Campaign", "metadata": metadata}
    server.kubectl(
        *("apply", "--server-side", "--force-conflicts", "--subresource=status"),
        *("--field-manager=robovast-operator", "--filename=-"),
        stdin=json.dumps({**said, "status": {"state": "Running"}}),
    )


@pytest.mark.parametrize(("one", "other"), [(OLDER, NEWER), (NEWER, OLDER)])
def test_what_was_written_as_one_version_is_read_and_changed_as_the_other(
    server: Cluster, one: str, other: str
) -> None:
    """By `kubectl apply` of either kind, as from Git, and with the same rules."""
    name = f"as-{one}"
    made = as_version(campaign(name, "default", 2, 3), one)
    server.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    tell(server, name)
    assert read(server, one, "default", name) == read(server, other, "default", name)
    made = as_version(made, other)
    made["spec"] = {**made["spec"], "parallelism": 7}
    server.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    server.kubectl("apply", "--server-side", "--force-conflicts", "-f", "-", stdin=json.dumps(made))
    assert read(server, one, "default", name)["spec"]["parallelism"] == 7
    made["spec"] = {**made["spec"], "image": "another"}
    with pytest.raises(StartFailed, match="`image` cannot be changed"):
        server.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    definition: Any = server.get("crd", "campaigns.robovast.io")
    assert definition["status"]["storedVersions"] == [OLDER]


@pytest.mark.parametrize(("one", "other"), [(OLDER, NEWER), (NEWER, OLDER)])
def test_a_field_that_leaves_git_together_with_the_version_leaves_the_object(
    server: Cluster, one: str, other: str
) -> None:
    """A tool that applies is the same one in either version, so its fields stay its own."""
    apply = ("apply", "--server-side", "--field-manager=tool", "--filename=-")
    made = campaign(f"from-{one}", "default", 2, 3)
    with_field = {**made, "spec": {**made["spec"], "queueName": "q"}}
    server.kubectl(*apply, stdin=json.dumps(as_version(with_field, one)))
    server.kubectl(*apply, stdin=json.dumps(as_version(made, other)))
    found = read(server, one, "default", f"from-{one}")
    assert "queueName" not in found["spec"]
    assert [(m["manager"], m["apiVersion"]) for m in found["metadata"]["managedFields"]] == [
        ("tool", f"robovast.io/{other}")
    ]


def test_kubectl_shows_the_newer_version_and_the_older_one_when_asked(
    server: Cluster, tmp_path: Path
) -> None:
    shown = ("get", "campaign", "there", "--output=jsonpath={.apiVersion}")
    assert server.kubectl(*shown) == f"robovast.io/{NEWER}"
    older = ("get", f"campaigns.{OLDER}.robovast.io", "there", shown[-1])
    assert server.kubectl(*older) == f"robovast.io/{OLDER}"
    assert f"VERSION:    {NEWER}" in server.kubectl("explain", "campaign")


@pytest.mark.parametrize("version", VERSIONS)
def test_an_object_of_either_version_is_listed_waited_for_edited_and_deleted(
    server: Cluster, version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"used-{version}"
    made = [campaign(name, "default", 2, 3, queueName=name), addition(name, name)]
    for obj in made:
        server.kubectl("apply", "-f", "-", stdin=json.dumps(as_version(obj, version)))
    tell(server, name)
    for kind, selected in (("campaigns", "spec.queueName"), ("configurations", "spec.campaign")):
        resource = f"{kind}.{version}.robovast.io"
        chosen = ("get", resource, f"--field-selector={selected}={name}", "--no-headers")
        (line,) = server.kubectl(*chosen).splitlines()
        assert line.split()[0] == name
    chosen = ("get", f"campaigns.{version}.robovast.io", "--field-selector=status.state=Running")
    assert name in server.kubectl(*chosen)
    campaigns, configurations = (
        f"{kind}.{version}.robovast.io/{name}" for kind in ("campaigns", "configurations")
    )
    state = "--for=jsonpath={.status.state}=Running"
    assert "condition met" in server.kubectl("wait", campaigns, state, "--timeout=20s")
    editor = tmp_path / "editor"
    editor.write_text("#!/bin/sh\nsed -i 's/runs: 2$/runs: 9/; s/queueName: .*/queueName: q/' $1\n")
    editor.chmod(0o755)
    monkeypatch.setenv("KUBE_EDITOR", str(editor))
    for one in (campaigns, configurations):
        assert "edited" in server.kubectl("edit", one)
    assert read(server, version, "default", name)["spec"]["queueName"] == "q"
    runs = server.kubectl("get", configurations, "--output=jsonpath={.spec.runs}")
    assert runs == "9"
    assert server.kubectl("delete", campaigns, configurations).count("deleted") == 2


def addition(name: str, campaign_name: str) -> dict[str, Any]:
    """A Configuration of a Campaign."""
    spec = {"campaign": campaign_name, "parameters": [{"x": 7}], "runs": 2}
    metadata = {"name": name, "namespace": "default"}
    return {"kind": "Configuration", "metadata": metadata, "spec": spec}


@pytest.mark.parametrize("version", VERSIONS)
def test_a_configuration_stays_with_its_campaign_in_either_version(
    server: Cluster, version: str
) -> None:
    made = as_version(addition(f"stays-{version}", "one"), version)
    server.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    made["spec"]["campaign"] = "two"
    with pytest.raises(StartFailed, match="`campaign` cannot be changed"):
        server.kubectl("apply", "--filename=-", stdin=json.dumps(made))


def test_a_rollback_to_a_chart_that_knows_both_goes_on_and_to_one_that_does_not_cannot(
    redefinable: Redefined,
) -> None:
    """So both had to be known before the newer one was served."""
    cluster = redefinable
    made = as_version(campaign("later", "default", 2, 3), NEWER)
    cluster.kubectl("apply", "--server-side", "--filename=-", stdin=json.dumps(made))
    cluster.define(of_chart_0_1_0())
    tell(cluster, "later")
    assert read(cluster, OLDER, "default", "later")["status"] == {"state": "Running"}
    cluster.define(of_one_version())

    def refused() -> str:
        try:
            tell(cluster, "later")
        except StartFailed as refusal:
            return str(refusal)
        return ""

    assert "invalid group/version" in eventually(refused)
    cluster.define(now())
    eventually(lambda: not refused())
    assert cluster.stored_versions() == [[OLDER]] * 2


def test_after_a_rollback_kubectl_asks_in_vain_until_it_reads_the_kinds_anew(
    redefinable: Redefined,
) -> None:
    """As docs/how-to/operate.md says, with its remedy; the older version is found by its name."""
    listing = ("get", "campaigns", "--output=name")
    assert "there" in redefinable.kubectl(*listing)
    remembered = redefinable.cache.rename(redefinable.cache.with_name("remembered"))
    redefinable.define(of_chart_0_1_0())
    remembered.rename(redefinable.cache)
    with pytest.raises(StartFailed, match="could not find the requested resource"):
        redefinable.kubectl(*listing)
    named = ("get", f"campaigns.{OLDER}.robovast.io", "--output=name")
    assert "there" in redefinable.kubectl(*named)
    redefinable.kubectl("api-resources", "--api-group=robovast.io")
    assert "there" in redefinable.kubectl(*listing)


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


@pytest.mark.parametrize("version", VERSIONS)
def test_the_table_says_what_a_person_asks(server: Cluster, version: str) -> None:
    campaigns, configurations = (
        f"{kind}.{version}.robovast.io" for kind in ("campaigns", "configurations")
    )
    table = server.kubectl("get", campaigns)
    assert table.split("\n")[0].split() == [
        "NAME", "STATE", "PROGRESS", "ACTIVE", "WAITING",
        "PASSED", "FAILED", "ERRORED", "VERDICT", "AGE",
    ]  # fmt: skip
    assert table.split("\n")[0] == server.kubectl("get", "vcamp").split("\n")[0]
    assert "QUEUE" in server.kubectl("get", campaigns, "--output=wide")
    made = as_version(addition("shown", "there"), version)
    server.kubectl("apply", "--filename=-", stdin=json.dumps(made))
    assert server.kubectl("get", configurations).split("\n")[0].split() == [
        "NAME", "CAMPAIGN", "VARIANTS", "PROGRESS", "PASSED", "FAILED", "ERRORED", "AGE",
    ]  # fmt: skip
    assert "there" in server.kubectl("get", "robovast", "--output=name")
    selected = ("get", campaigns, "--output=name", "--field-selector")
    assert "there" not in server.kubectl(*selected, "spec.queueName=none")


@pytest.mark.parametrize("version", VERSIONS)
def test_an_unknown_key_is_refused_not_dropped(server: Cluster, version: str) -> None:
    wrong = as_version(campaign("wrong", "default", 1, 1), version)
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


def create(server: Cluster, name: str, spec: dict[str, Any], version: str = OLDER) -> str:
    """What is said to a new Campaign; empty when it is taken."""
    made = as_version(campaign(name, "default", 1, 1), version)
    made["spec"] |= spec
    try:
        server.kubectl("create", "--filename=-", stdin=json.dumps(made))
    except StartFailed as refusal:
        return str(refusal)
    return ""


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("spec", SECRETS)
def test_a_secret_that_was_not_made_for_campaigns_is_refused_with_the_remedy(
    server: Cluster, version: str, spec: dict[str, Any]
) -> None:
    told = create(server, "thief", spec, version)
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
