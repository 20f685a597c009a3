"""The chart, judged by Helm and by an API server."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable
from typing import Any

import pytest
import yaml
from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster
from support.kube.chart import CHART, Object, of_kind, rendered, template
from support.kube.fake_cluster import SCENARIO, SETTINGS
from support.kube.fake_cluster import campaign as campaign_object
from support.kube.operator_process import campaign
from support.patience import eventually

from robovast.kubeapi.notice import Named, Notice, Order
from robovast.kubeapi.resources import Scheduling
from robovast.kubeapi.share_job import Upload, share_job
from robovast_operator.kube.metrics import Metrics
from robovast_operator.kube.store import Store
from robovast_operator.kube.work_queue import WorkQueue
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Accepted
from robovast_operator.planning.revisions import next_revision
from robovast_operator.planning.shards import first_attempts
from robovast_operator.pods.jobs import shard_job, task_job
from robovast_operator.pods.templates import notify_pod


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"operator": {"replcas": 2}}, "at '/operator': additional properties 'replcas'"),
        ({"storge": {}}, "additional properties 'storge' not allowed"),
        ({"storage": {"embedded": {"size": "10 GB"}}}, "/storage/embedded/size': '10 GB'"),
        ({"kueue": {"share": 110}}, "/kueue/share': maximum: got 110, want 100"),
        ({"operator": {"resources": {"limit": {}}}}, "'limit' not allowed"),
        ({"operator": {"replicas": -1}}, "minimum: got -1, want 0"),
        ({"scheduling": {"hostNetwork": True}}, "'hostNetwork' not allowed"),
        ({"storage": {"embedded": {"enabled": False}}}, "storage.external.endpoint is needed"),
        (
            {"metrics": {"enabled": False, "serviceMonitor": {"enabled": True}}},
            "metrics.serviceMonitor, metrics.prometheusRule and metrics.grafanaDashboard require "
            "metrics.enabled=true",
        ),
    ],
)
def test_helm_refuses_a_mistake_in_the_values_and_says_where(values: Object, told: str) -> None:
    with pytest.raises(ValueError, match="Error: ") as refusal:
        template(values)
    assert told in str(refusal.value)


def test_the_chart_as_part_of_another_takes_that_ones_globals() -> None:
    assert rendered({"global": {"site": "lab"}}) != []


def test_pods_of_the_chart_go_where_the_admin_says() -> None:
    scheduling = {
        "nodeSelector": {"pool": "system"},
        "tolerations": [{"key": "system", "operator": "Exists"}],
        "affinity": {"nodeAffinity": {}},
        "priorityClassName": "high",
    }
    secrets = [{"name": "registry"}]
    values = {"scheduling": scheduling, "page": {"enabled": True}, "imagePullSecrets": secrets}
    scheduled = scheduling | {"nodeSelector": {"kubernetes.io/os": "linux", "pool": "system"}}
    for pod in pods_of_chart(values).values():
        assert {key: pod[key] for key in scheduling} == scheduled
        assert pod["imagePullSecrets"] == secrets
        assert pod["enableServiceLinks"] is False


def test_a_new_version_of_the_chart_alone_restarts_nothing() -> None:
    """Results are stored all the time; only a change of the S3 server itself may stop it."""
    for workload in workloads({"page": {"enabled": True}}).values():
        labels = workload["spec"]["template"]["metadata"]["labels"]
        assert not {"helm.sh/chart", "app.kubernetes.io/version"} & labels.keys()


def test_a_drain_waits_for_a_second_operator_and_for_a_protected_server() -> None:
    def budgets(values: Object) -> dict[str, Any]:
        found = of_kind(rendered(values), "PodDisruptionBudget")
        return {name: obj["spec"] for name, obj in found.items()}

    alone = budgets({})
    assert alone.keys() == {"robovast-s3"}
    assert alone["robovast-s3"]["maxUnavailable"] == 1
    protected = {"operator": {"replicas": 2}, "storage": {"embedded": {"maxUnavailable": 0}}}
    both = budgets(protected)
    assert both["robovast-operator"]["minAvailable"] == 1
    assert both["robovast-s3"]["maxUnavailable"] == 0
    for spec in both.values():
        assert spec["unhealthyPodEvictionPolicy"] == "AlwaysAllow"


def test_namespaces_of_the_operator_get_credentials_queue_and_limits() -> None:
    values = {
        "operator": {"namespaces": ["a"]},
        "storage": {"credentials": {"namespaces": ["a", "b"]}},
        "kueue": {"enabled": True},
        "networkPolicy": {"runs": True},
    }
    objects = rendered(values)
    everywhere = {"system", "a", "b"}
    assert of_kind(objects, "Secret").keys() == {f"{n}/robovast-storage" for n in everywhere}
    assert of_kind(objects, "LocalQueue").keys() == {f"{n}/robovast" for n in everywhere}
    runs = {name for name in of_kind(objects, "NetworkPolicy") if name.endswith("/robovast-runs")}
    assert runs == {f"{n}/robovast-runs" for n in everywhere}
    secrets = of_kind(objects, "Secret").values()
    assert len({obj["stringData"]["secretKey"] for obj in secrets}) == 1


@pytest.mark.parametrize(
    ("storage", "kept"),
    [
        ({}, {"PersistentVolumeClaim/robovast-s3", "Secret/system/robovast-storage"}),
        ({"embedded": {"keep": False}}, set()),
        ({"credentials": {"existingSecret": "own"}}, {"PersistentVolumeClaim/robovast-s3"}),
        ({"embedded": {"enabled": False}, "external": {"endpoint": "https://s3"}}, set()),
    ],
)
def test_the_keys_of_the_volume_stay_with_it(storage: Object, kept: set[str]) -> None:
    """When the chart is removed; copies of the keys in other namespaces are made again."""
    credentials = {"namespaces": ["a"], **storage.get("credentials", {})}
    values = {"storage": storage | {"credentials": credentials}}
    found = {
        f"{kind}/{name}"
        for kind in ("PersistentVolumeClaim", "Secret")
        for name, obj in of_kind(rendered(values), kind).items()
        if obj["metadata"].get("annotations", {}).get("helm.sh/resource-policy") == "keep"
    }
    assert found == kept


def test_viewers_may_open_the_page_and_read_no_secret() -> None:
    viewers = [
        {"kind": "Group", "name": "team-a"},
        {"kind": "ServiceAccount", "name": "bot", "namespace": "team-a"},
    ]
    objects = rendered({"page": {"enabled": True, "viewers": viewers}})
    assert of_kind(objects, "RoleBinding")["robovast-page"]["subjects"] == viewers
    role = of_kind(objects, "Role")["robovast-page"]
    rights = {(verb, kind) for r in role["rules"] for verb in r["verbs"] for kind in r["resources"]}
    assert {("get", "deployments"), ("list", "pods"), ("get", "pods/log")} < rights
    assert ("create", "pods/portforward") in rights
    assert not {kind for _, kind in rights} - {
        "deployments",
        "pods",
        "pods/log",
        "pods/portforward",
    }
    assert "robovast-page" not in of_kind(rendered({"page": {"enabled": True}}), "Role")
    with pytest.raises(ValueError, match="viewers"):
        template({"page": {"viewers": [{"kind": "ServiceAccount", "name": "bot"}]}})


DOCS = CHART.parents[1] / "docs"
NAMES = ("how-to/install-on-kubernetes", "how-to/quotas", "how-to/multikueue", "how-to/operate")
NAMES += ("reference/cluster-security", "reference/monitoring", "reference/sizing")
PAGE = "\n".join((DOCS / f"{name}.md").read_text() for name in NAMES)
PAGES = PAGE + (DOCS / "reference/cluster-requirements.md").read_text()


@pytest.mark.parametrize("block", re.findall(r"```yaml\n(?!apiVersion)(.*?)```", PAGES, re.DOTALL))
def test_values_in_the_admins_page_are_values_of_the_chart(block: str) -> None:
    assert rendered(yaml.safe_load(block)) != []


def rows(heading: str) -> set[str]:
    """First column of the table of that heading in the admin's page, as code or plain."""
    table = PAGE.partition(f"| {heading} |")[2].partition("\n\n")[0]
    return {re.split(r"[`{ ]+", line)[1] for line in table.splitlines()[2:]}


def test_the_admins_page_explains_every_figure_and_every_alert() -> None:
    figures = generate_figures()
    assert rows("metric") == figures
    values = {"metrics": {"prometheusRule": {"enabled": True}}}
    (rule,) = of_kind(rendered(values), "PrometheusRule").values()
    alerts = rule["spec"]["groups"][0]["rules"]
    assert rows("alert") == {alert["alert"] for alert in alerts}
    for alert in alerts:
        asked = set(re.findall(r"robovast_\w+", alert["expr"]))
        assert asked, alert
        assert asked <= figures, alert


def test_the_dashboard_shows_figures_that_there_are() -> None:
    values = {"metrics": {"grafanaDashboard": {"enabled": True, "labels": {"folder": "labs"}}}}
    board = of_kind(rendered(values), "ConfigMap")["robovast-dashboard"]
    assert {"grafana_dashboard", "folder"} <= board["metadata"]["labels"].keys()
    (text,) = board["data"].values()
    asked = [t["expr"] for panel in json.loads(text)["panels"] for t in panel["targets"]]
    known = {figure.removesuffix("_total") for figure in generate_figures()}
    suffixes = r"(_total|_bucket)?$"
    for expression in asked:
        shown = re.findall(r"robovast_\w+", expression)
        assert shown, expression
        assert {re.sub(suffixes, "", figure) for figure in shown} <= known, expression
    assert "robovast-dashboard" not in of_kind(rendered({}), "ConfigMap")


def generate_figures() -> set[str]:
    """What the operator's /metrics has, as PromQL names it."""
    metrics = Metrics()
    metrics.request("GET", "/api/v1/namespaces/lab/pods", 200)
    store = Store()
    meta = {"namespace": "lab", "name": "drive", "resourceVersion": "1", "uid": "1"}
    store.put_campaign({"metadata": meta, "status": {}})
    page = metrics.page(store, WorkQueue(), leading=True).decode()
    names = set(re.findall(r"^# TYPE (\w+) ", page, re.MULTILINE))
    return {name for name in names if not name.endswith("_created")}


def workloads(values: Object) -> dict[str, Object]:
    objects = rendered(values)
    return of_kind(objects, "Deployment") | of_kind(objects, "StatefulSet")


def pods_of_chart(values: Object) -> dict[str, Object]:
    return {n: obj["spec"]["template"]["spec"] for n, obj in workloads(values).items()}


def pods_of_campaigns() -> dict[str, Object]:
    """One pod of each kind of Job, by what it is."""
    found = {}
    for name, source in {
        "inline": {"inline": {"files": {"scenario.osc": SCENARIO}}},
        "configMap": {"configMap": {"name": "mine"}},
    }.items():
        obj = campaign_object(source=source)
        obj["spec"]["vast"]["execution"]["secondary_containers"] = ["simulation"]
        made = accept(obj, {"scenario.osc": SCENARIO.encode()}, SETTINGS)
        assert isinstance(made, Accepted)
        revision = next_revision(made, (), (), "plan-0")
        assert revision is not None
        (shard,) = first_attempts(made.identity, [revision])
        jobs = {"shard": shard_job(made, SETTINGS, shard)}
        for command in ("compose", "finish", "purge"):
            jobs[command] = task_job(made, SETTINGS, command, command, "plan-0")
        for role, job in jobs.items():
            found[f"{role}-{name}".lower()] = job["spec"]["template"]["spec"]
    upload = Upload("drive", "drive", "http://s3:9000", "agent:1")
    found["share"] = share_job(upload, "share")["spec"]["template"]["spec"]
    found["notify"] = notify_pod(SETTINGS, Scheduling(), order())
    return found


def order() -> Order:
    named = Named(namespace="lab", name="drive", uid="1")
    notice = Notice(id="1", event="Finished", time="2026-11-21T07:00:00Z", campaign=named)
    return Order(notice=notice, receivers=[])


@pytest.fixture
def restricted(fake_cluster: Cluster, namespace: str) -> str:
    label = "pod-security.kubernetes.io/enforce=restricted"
    fake_cluster.kubectl("label", "namespace", namespace, label)
    fake_cluster.kubectl(
        "create", "serviceaccount", "robovast-operator", f"--namespace={namespace}"
    )
    return namespace


def test_restricted_pod_security_admits_every_pod_of_ours(
    fake_cluster: Cluster, restricted: str
) -> None:
    def pod(name: str, spec: Object) -> Object:
        meta = {"name": name, "namespace": restricted}
        return {"apiVersion": "v1", "kind": "Pod", "metadata": meta, "spec": spec}

    ours = pods_of_chart({"page": {"enabled": True}}) | pods_of_campaigns()
    assert len(ours) == 3 + 2 * 4 + 2
    items = {
        "apiVersion": "v1",
        "kind": "List",
        "items": [pod(name, spec) for name, spec in ours.items()],
    }
    fake_cluster.kubectl("create", "--dry-run=server", "--filename=-", stdin=json.dumps(items))
    free = pod("free", {"containers": [{"name": "free", "image": "any"}]})
    with pytest.raises(StartFailed, match="violates PodSecurity"):
        fake_cluster.kubectl("create", "--dry-run=server", "--filename=-", stdin=json.dumps(free))


def test_policies_of_the_site_refuse_campaigns_with_a_message(
    fake_cluster: Cluster, namespace: str
) -> None:
    policies = {"registries": ["ghcr.io/acme", "registry.lab:5000"], "queueRequired": True}
    values = {"policies": policies, "operator": {"namespaces": [namespace]}}
    assert not [obj for obj in rendered() if "Validating" in obj["kind"]]
    objects = [o for o in rendered(values, namespace=namespace) if "Validating" in o["kind"]]
    assert len(objects) == 2

    def apply(name: str, **spec: Any) -> None:
        fake_cluster.apply(campaign(name, namespace, 1, 1, suspend=True, **spec))

    apply("before")
    fake_cluster.apply(*objects)
    try:
        numbers = itertools.count()
        eventually(lambda: refused(lambda: apply(f"early-{next(numbers)}")))
        for image in ("ghcr.io/acme-evil/runs:1", "docker.io/ghcr.io/acme/runs", "fake"):
            told = refused(lambda: apply("wrong", image=image, queueName="robovast"))  # noqa: B023
            listed = "ghcr.io/acme, registry.lab:5000"
            assert f"Image {image} is not from an allowed registry ({listed})." in told
        for image in ("docker.io/models", "ghcr.io/acme/models"):
            other = campaign("assets", namespace, 1, 1, queueName="robovast", suspend=True)
            assets = [{"path": "/a", "image": image}, {"path": "/b", "claim": "worlds"}]
            other["spec"]["vast"]["execution"] |= {
                "image": "ghcr.io/acme/runs", "kubernetes": {"assets": assets},
            }  # fmt: skip
            told = refused(lambda: fake_cluster.apply(other))  # noqa: B023
            assert ("An image of execution.kubernetes.assets" in told) == ("acme" not in image)
        told = refused(lambda: apply("wrong", image="ghcr.io/acme/runs:1"))
        assert "Campaigns must name a queue. Set spec.queueName." in told
        apply("right", image="registry.lab:5000/team/runs:1", queueName="robovast")
        fake_cluster.kubectl(f"--namespace={namespace}", "label", "campaign/before", "looked=at")
        assert "is not from an allowed registry" in refused(lambda: apply("before", parallelism=2))
    finally:
        names = [f"{obj['kind']}/{obj['metadata']['name']}" for obj in objects]
        fake_cluster.kubectl("delete", *names)


def refused(act: Callable[[], None]) -> str:
    """What the API server says against it; nothing when it does not."""
    try:
        act()
    except StartFailed as refusal:
        return str(refusal)
    return ""


def test_the_queue_is_as_large_as_the_nodes_that_take_pods(fake_cluster: Cluster) -> None:
    names = [node["metadata"]["name"] for node in nodes(fake_cluster)]
    fake_cluster.kubectl("cordon", names[0])
    fake_cluster.kubectl("taint", "node", names[1], "gpu=only:NoSchedule")
    try:
        left = [n["status"]["allocatable"] for n in nodes(fake_cluster)[2:]]
        assert {(a["cpu"], a["memory"]) for a in left} == {("64", "256Gi")}
        values = {"kueue": {"enabled": True, "share": 50}}
        expected = {"cpu": f"{len(left) * 32_000}m", "memory": f"{len(left) * 128 * 1024}Mi"}
        assert quota(values, fake_cluster) == expected
        asking = {**values, "agent": {"diskRequest": "5Gi"}}
        disk = {"ephemeral-storage": f"{len(left) * 512 * 1024}Mi"}
        assert quota(asking, fake_cluster) == expected | disk
    finally:
        fake_cluster.kubectl("uncordon", names[0])
        fake_cluster.kubectl("taint", "node", names[1], "gpu-")


def test_the_queue_is_as_large_as_it_is_said_to_be(fake_cluster: Cluster) -> None:
    given = {"cpu": "64", "memory": "256Gi", "nvidia.com/gpu": 4}
    assert quota({"kueue": {"enabled": True, "resources": given}}, fake_cluster) == {
        **given,
        "nvidia.com/gpu": "4",
    }
    assert quota({"kueue": {"enabled": True}}, None) == {"cpu": "4", "memory": "8Gi"}
    asking = {"kueue": {"enabled": True}, "agent": {"diskRequest": "5Gi"}}
    assert "ephemeral-storage" in quota(asking, None)


def nodes(cluster: Cluster) -> list[Any]:
    found: Any = cluster.get("nodes")["items"]
    return list(found)


def quota(values: Object, cluster: Cluster | None) -> dict[str, str]:
    """What the ClusterQueue offers, by resource."""
    (queue,) = of_kind(rendered(values, cluster), "ClusterQueue").values()
    (group,) = queue["spec"]["resourceGroups"]
    offered = {r["name"]: r["nominalQuota"] for r in group["flavors"][0]["resources"]}
    assert sorted(offered) == group["coveredResources"]
    return offered
