"""The chart keeps kube-linter's rules about permissions and pods; its program cannot be built here.

Source of the rules: the templates of kube-linter's default and optional checks, by name.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.kube.chart import Object, rendered

EVERYTHING: list[Object] = [
    {},
    {"page": {"enabled": True, "viewers": [{"kind": "Group", "name": "team"}]}},
    {"operator": {"namespaces": ["team-a", "team-b"]}, "kueue": {"enabled": True}},
    {"metrics": {"prometheusRule": {"enabled": True}, "serviceMonitor": {"enabled": True}}},
]
MAY_CREATE = {("robovast-operator", "jobs")}
"""Who may create what starts pods (access-to-create-pods): the operator makes Jobs."""
STARTS_PODS = {
    *("pods", "deployments", "statefulsets", "daemonsets", "replicasets", "cronjobs", "jobs"),
    "replicationcontrollers",
}


@pytest.fixture(params=EVERYTHING, ids=["defaults", "page", "namespaces", "metrics"])
def objects(request: pytest.FixtureRequest) -> list[Object]:
    return rendered(request.param)


def rules(objects: list[Object]) -> Iterator[tuple[str, Object]]:
    for obj in objects:
        if obj["kind"] in {"Role", "ClusterRole"}:
            yield from ((obj["metadata"]["name"], rule) for rule in obj.get("rules") or ())


def pod_specs(objects: list[Object]) -> Iterator[tuple[str, Object]]:
    for obj in objects:
        spec = obj.get("spec", {})
        if obj["kind"] == "Pod":
            yield obj["metadata"]["name"], spec
        elif "spec" in spec.get("template", {}):
            yield obj["metadata"]["name"], spec["template"]["spec"]


def test_no_role_has_a_wildcard_or_reads_secrets(objects: list[Object]) -> None:
    found = list(rules(objects))
    assert found
    for name, rule in found:
        for key in ("apiGroups", "resources", "verbs"):
            assert "*" not in rule.get(key, ()), f"{name}: {key}"
        if "secrets" in rule.get("resources", ()):
            assert rule.get("resourceNames"), f"{name} may read every Secret: {rule}"
        assert not {"pods/exec", "pods/attach", "nodes/proxy"} & set(rule.get("resources", ()))
        assert not {"bind", "escalate", "impersonate"} & set(rule["verbs"])


def test_only_the_operator_may_create_what_starts_pods(objects: list[Object]) -> None:
    found = {
        (name, kind)
        for name, rule in rules(objects)
        if "create" in rule["verbs"]
        for kind in STARTS_PODS & set(rule.get("resources", ()))
    }
    assert {(name.removesuffix("-system"), kind) for name, kind in found} == MAY_CREATE


def test_no_binding_gives_the_rights_of_an_administrator(objects: list[Object]) -> None:
    bindings = [obj for obj in objects if obj["kind"].endswith("RoleBinding")]
    assert bindings
    for binding in bindings:
        assert binding["roleRef"]["name"] not in {"cluster-admin", "admin", "edit"}
        for subject in binding["subjects"]:
            assert subject["name"] not in {"default", "system:authenticated", "system:anonymous"}


def test_every_pod_is_restricted_and_has_limits(objects: list[Object]) -> None:
    found = list(pod_specs(objects))
    assert found
    for name, spec in found:
        assert not any(spec.get(key) for key in ("hostNetwork", "hostPID", "hostIPC")), name
        assert spec.get("serviceAccountName", "default") != "default" or (
            spec.get("automountServiceAccountToken") is False
        ), f"{name} uses the default account"
        for container in [*spec.get("initContainers", ()), *spec["containers"]]:
            where = f"{name}/{container['name']}"
            security = {**spec.get("securityContext", {}), **container.get("securityContext", {})}
            assert security.get("runAsNonRoot") is True, where
            assert security.get("allowPrivilegeEscalation") is False, where
            assert security.get("readOnlyRootFilesystem") is True, where
            assert security.get("capabilities", {}).get("drop") == ["ALL"], where
            assert not container["image"].endswith(":latest"), where
            assert ":" in container["image"].rpartition("/")[2], where
            resources = container.get("resources", {})
            assert {"cpu", "memory"} <= set(resources.get("requests", {})), where
            assert "memory" in resources.get("limits", {}), where
            for variable in container.get("env", ()):
                is_secret = variable["name"].endswith(("SECRET", "PASSWORD", "KEY", "TOKEN"))
                assert not (is_secret and "value" in variable), f"{where}: {variable['name']}"
