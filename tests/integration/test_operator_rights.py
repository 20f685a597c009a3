"""What the operator may do, as the API server answers for the account that the chart makes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from robovast_testbed.kubernetes import Cluster
from support.kube.chart import rendered
from support.kube.operator_process import ACCOUNT, SYSTEM

Rights = set[tuple[str, str, str]]
"""Verb, resource with its API group, and the only name where there is one."""

CAMPAIGNS = {
    "campaigns.robovast.io": "list watch patch",
    "campaigns.robovast.io/status": "patch",
    "configurations.robovast.io": "list watch create",
    "configurations.robovast.io/status": "patch",
    "jobs.batch": "list watch create patch delete",
    "configmaps": "get list create delete",
    "pods": "list patch",
    "persistentvolumeclaims": "get",
    "resourcequotas": "list",
    "limitranges": "list",
    "resourceclaimtemplates.resource.k8s.io": "get",
    "events": "list create",
    "workloads.kueue.x-k8s.io": "list patch",
    "localqueues.kueue.x-k8s.io": "get",
    "workloadpriorityclasses.kueue.x-k8s.io": "get",
    "multikueueclusters.kueue.x-k8s.io": "get",
    "localqueues.visibility.kueue.x-k8s.io/pendingworkloads": "get",
}
"""Verbs where campaigns are executed."""

LEASES = {
    ("list", "leases.coordination.k8s.io", "robovast-operator"),
    ("create", "subjectaccessreviews.authorization.k8s.io", ""),
}
"""In every namespace: Leases of other installations, and whether their accounts are operators."""
LEASE = LEASES | {
    ("create", "leases.coordination.k8s.io", ""),
    ("update", "leases.coordination.k8s.io", "robovast-operator"),
}

EVERYBODY = {
    ("create", f"{kind}.authorization.k8s.io", "")
    for kind in ("selfsubjectaccessreviews", "selfsubjectrulesreviews")
} | {("create", "selfsubjectreviews.authentication.k8s.io", "")}
"""What Kubernetes lets every account do."""

NEVER = (
    ("get", "secrets"),
    ("list", "secrets"),
    ("create", "secrets"),
    ("create", "pods"),
    ("delete", "pods"),
    ("create", "pods/exec"),
    ("get", "pods/exec"),
    ("create", "pods/portforward"),
    ("get", "pods/log"),
    ("create", "serviceaccounts/token"),
    ("update", "configmaps"),
    ("patch", "configmaps"),
    ("deletecollection", "configmaps"),
    ("create", "campaigns.robovast.io"),
    ("delete", "campaigns.robovast.io"),
    ("create", "deployments.apps"),
    ("create", "cronjobs.batch"),
    ("delete", "persistentvolumeclaims"),
    ("get", "nodes"),
    ("get", "namespaces"),
    ("patch", "customresourcedefinitions.apiextensions.k8s.io"),
    ("create", "roles.rbac.authorization.k8s.io"),
    ("bind", "clusterroles.rbac.authorization.k8s.io"),
    ("escalate", "clusterroles.rbac.authorization.k8s.io"),
    ("impersonate", "users"),
    ("impersonate", "serviceaccounts"),
    ("approve", "certificatesigningrequests.certificates.k8s.io"),
    ("*", "*"),
    ("*", "jobs.batch"),
    ("get", "*"),
)

NARROW = "narrow-system"
NARROW_ACCOUNT = f"system:serviceaccount:{NARROW}:robovast-operator"


@pytest.fixture(scope="module")
def narrow(fake_cluster: Cluster) -> Iterator[str]:
    """Rights of an operator that works in one namespace alone; returns that."""
    for namespace in (NARROW, "narrow-lab"):
        fake_cluster.kubectl("create", "namespace", namespace)
    values = {"operator": {"namespaces": ["narrow-lab"]}, "crds": {"enabled": False}}
    objects = rendered(values, namespace=NARROW)
    kinds = {"ServiceAccount", "Role", "RoleBinding", "ClusterRole", "ClusterRoleBinding"}
    (role,) = (obj for obj in objects if obj["kind"] == "ClusterRole")
    leases, reviews = role["rules"]
    assert (leases["resourceNames"], leases["verbs"]) == (["robovast-operator"], ["list"])
    assert (reviews["resources"], reviews["verbs"]) == (["subjectaccessreviews"], ["create"])
    for obj in (obj for obj in objects if obj["kind"] in kinds):
        obj["metadata"].setdefault("namespace", NARROW)
        fake_cluster.apply(obj)
    yield "narrow-lab"
    for namespace in (NARROW, "narrow-lab"):
        fake_cluster.kubectl("delete", "namespace", namespace, "--wait=false")


def asked(cluster: Cluster, account: str, *reviews: dict[str, Any]) -> list[dict[str, Any]]:
    """What the API server answers the account on reviews of itself."""
    items = {"apiVersion": "v1", "kind": "List", "items": reviews}
    answer = cluster.kubectl(
        *("create", "--filename=-", f"--as={account}", "--output=yaml"), stdin=json.dumps(items)
    )
    return list(yaml.safe_load_all(answer))


def rights(cluster: Cluster, account: str, namespace: str) -> Rights:
    """Everything that the account may do in a namespace."""
    review = {
        "apiVersion": "authorization.k8s.io/v1",
        "kind": "SelfSubjectRulesReview",
        "spec": {"namespace": namespace},
    }
    (answer,) = asked(cluster, account, review)
    return {
        (verb, _named(resource, group), name)
        for rule in answer["status"]["resourceRules"]
        for verb in rule["verbs"]
        for group in rule["apiGroups"]
        for resource in rule["resources"]
        for name in rule.get("resourceNames") or ("",)
    }


def _named(resource: str, group: str) -> str:
    kind, slash, part = resource.partition("/")
    return (f"{kind}.{group}" if group else kind) + slash + part


def refused(cluster: Cluster, account: str, namespace: str) -> list[tuple[str, str]]:
    """Those of NEVER that the account may not do."""
    reviews = []
    for verb, what in NEVER:
        name, _, part = what.partition("/")
        kind, _, group = name.partition(".")
        attributes = {
            "verb": verb, "group": "*" if what == "*" else group,
            "resource": kind, "subresource": part, "namespace": namespace,
        }  # fmt: skip
        reviews.append(
            {
                "apiVersion": "authorization.k8s.io/v1",
                "kind": "SelfSubjectAccessReview",
                "spec": {"resourceAttributes": attributes},
            }
        )
    answers = asked(cluster, account, *reviews)
    return [
        asking
        for asking, answer in zip(NEVER, answers, strict=True)
        if not answer["status"]["allowed"]
    ]


def campaign_rights() -> Rights:
    return {(verb, kind, "") for kind, verbs in CAMPAIGNS.items() for verb in verbs.split()}


def test_an_operator_of_all_namespaces_may_do_what_it_needs_and_nothing_else(
    fake_cluster: Cluster,
) -> None:
    assert rights(fake_cluster, ACCOUNT, "default") == campaign_rights() | EVERYBODY | LEASES
    assert rights(fake_cluster, ACCOUNT, SYSTEM) == campaign_rights() | EVERYBODY | LEASE
    for namespace in ("default", SYSTEM, "kube-system", ""):
        assert refused(fake_cluster, ACCOUNT, namespace) == list(NEVER)


def test_an_operator_of_one_namespace_may_do_nothing_elsewhere(
    fake_cluster: Cluster, narrow: str
) -> None:
    assert rights(fake_cluster, NARROW_ACCOUNT, narrow) == campaign_rights() | EVERYBODY | LEASES
    assert rights(fake_cluster, NARROW_ACCOUNT, NARROW) == EVERYBODY | LEASE
    assert rights(fake_cluster, NARROW_ACCOUNT, "default") == EVERYBODY | LEASES
    for namespace in (narrow, NARROW, "default", ""):
        assert refused(fake_cluster, NARROW_ACCOUNT, namespace) == list(NEVER)
