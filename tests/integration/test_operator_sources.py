"""The files of a document in a ConfigMap: all runs of a campaign have those that it began with."""

from __future__ import annotations

from typing import Any

import pytest
from robovast_testbed.kubernetes import Cluster
from support.kube.operator_process import (
    NewOperator,
    OperatorProcess,
    campaign,
    condition,
    created,
    finished,
    status,
)
from support.patience import eventually


@pytest.fixture
def operator(new_operator: NewOperator) -> OperatorProcess:
    """An operator that works."""
    made = new_operator()
    made.start()
    return made


def apply(cluster: Cluster, namespace: str, text: str = "", **spec: Any) -> None:
    """A Campaign, and the ConfigMap with its scenario."""
    made = campaign("few", namespace, 3, 2, **spec)
    files = {**made["spec"]["source"]["inline"]["files"], "note.txt": text}
    made["spec"]["source"] = {"configMap": {"name": "mine"}}
    cluster.apply(made, config_map(namespace, files))


def config_map(namespace: str, files: dict[str, str]) -> dict[str, Any]:
    labels = {"robovast.io/source": "true"}
    meta = {"name": "mine", "namespace": namespace, "labels": labels}
    return {"apiVersion": "v1", "kind": "ConfigMap", "metadata": meta, "data": files}


def copy_of(cluster: Cluster, namespace: str) -> dict[str, Any]:
    """The operator's copy."""
    found: Any = cluster.get("configmaps", f"--namespace={namespace}")
    (copy,) = (item for item in found["items"] if item["metadata"]["name"].endswith("-files"))
    return dict(copy)


@pytest.mark.parametrize("gone", [False, True], ids=["edited", "deleted"])
def test_later_runs_have_the_files_of_the_first_whatever_becomes_of_the_config_map(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess, gone: bool
) -> None:
    apply(fake_cluster, namespace, "first", suspend=True)
    eventually(lambda: status(fake_cluster, namespace, "few").get("bucket"), told=operator.told)
    operator.kill()
    if gone:
        fake_cluster.kubectl("delete", "configmap/mine", f"--namespace={namespace}")
    else:
        fake_cluster.apply(config_map(namespace, {"scenario.osc": "no scenario", "note.txt": ""}))
    operator.start()
    resume = '{"spec": {"suspend": false}}'
    fake_cluster.kubectl(
        *("patch", "campaign", "few", f"--namespace={namespace}", "--type=merge"),
        *("--patch", resume),
    )
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert condition(status(fake_cluster, namespace, "few"), "Passed")["status"] == "True"
    copy = copy_of(fake_cluster, namespace)
    assert (copy["data"]["note.txt"], copy["immutable"]) == ("first", True)
    (job,) = (name for name in created(fake_cluster, namespace, "jobs") if "finish" not in name)
    found: Any = fake_cluster.get("job", job, f"--namespace={namespace}")
    volumes = found["spec"]["template"]["spec"]["volumes"]
    (source,) = next(v["projected"]["sources"] for v in volumes if v["name"] == "files")
    assert source["configMap"]["name"] == copy["metadata"]["name"]


def test_files_that_were_changed_before_they_were_copied_are_told(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    """As of a campaign that a version without copies has begun."""
    apply(fake_cluster, namespace, "first", suspend=True)
    eventually(lambda: status(fake_cluster, namespace, "few").get("bucket"), told=operator.told)
    operator.kill()
    copy = copy_of(fake_cluster, namespace)["metadata"]["name"]
    fake_cluster.kubectl("delete", f"configmap/{copy}", f"--namespace={namespace}")
    apply(fake_cluster, namespace, "second")
    operator.start()

    def accepted(truth: str, reason: str) -> bool:
        found = condition(status(fake_cluster, namespace, "few"), "Accepted")
        return (found["status"], found["reason"]) == (truth, reason)

    eventually(lambda: accepted("False", "SourceChanged"), told=operator.told)
    told = condition(status(fake_cluster, namespace, "few"), "Accepted")["message"]
    assert "`note.txt`" in told
    apply(fake_cluster, namespace, "first")
    eventually(lambda: finished(fake_cluster, namespace, "few"), told=operator.told)
    assert accepted("True", "Valid")


def test_runs_of_configurations_that_come_and_go_keep_their_places(
    fake_cluster: Cluster, namespace: str, operator: OperatorProcess
) -> None:
    """One goes before the next comes: the plan and its document name both, in order."""
    made = campaign("few", namespace, 1, 2)
    fake_cluster.apply({**made, "spec": {**made["spec"], "suspend": True}})
    for name, others in (("a", 1), ("b", 2)):
        spec = {"campaign": "few", "parameters": [{"x": others}], "runs": 2}
        meta = {"name": name, "namespace": namespace}
        kind = {"apiVersion": "robovast.io/v1beta1", "kind": "Configuration"}
        fake_cluster.apply({**kind, "metadata": meta, "spec": spec})
        eventually(lambda: len(plans(fake_cluster, namespace)) > others, told=operator.told)  # noqa: B023
        fake_cluster.kubectl("delete", f"configuration/{name}", f"--namespace={namespace}")
    documents = [plan["data"]["document.vast"] for plan in plans(fake_cluster, namespace)]
    assert [text.count("- name: a") for text in documents] == [0, 1, 1]
    assert documents[-1].index("name: a") < documents[-1].index("name: b")


def plans(cluster: Cluster, namespace: str) -> list[dict[str, Any]]:
    """The plans of a campaign, oldest first."""
    found: Any = cluster.get("configmaps", f"--namespace={namespace}")
    named = {item["metadata"]["name"]: item for item in found["items"]}
    return [named[name] for name in sorted(named) if "-plan-" in name]
