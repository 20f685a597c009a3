"""Argo Workflows on fake nodes: its controller, and a stand-in for its executor."""

from __future__ import annotations

import threading
from http.client import HTTPException
from typing import Any

from robovast_testbed import controlplane, gobuild
from robovast_testbed.bed import Daemon
from robovast_testbed.kubernetes import Cluster, write_kubeconfig

from support.kube.requests import Requests

CONTROLLER = gobuild.Program(
    "workflow-controller",
    "github.com/argoproj/argo-workflows/v3",
    "v3.7.3",
    "./cmd/workflow-controller",
)
RESOURCES = "/apis/argoproj.io/v1alpha1/namespaces/{}/{}"
WORKFLOW_LABEL = "workflows.argoproj.io/workflow"
COMPLETED_LABEL = "workflows.argoproj.io/completed"
PHASE_LABEL = "workflows.argoproj.io/phase"
USER = "argo-workflows"

POD_STAGE = """\
apiVersion: kwok.x-k8s.io/v1alpha1
kind: Stage
metadata: {name: workflow-pod-complete}
spec:
  weight: 1000
  resourceRef: {apiGroup: v1, kind: Pod}
  selector:
    matchExpressions:
      - {key: .metadata.deletionTimestamp, operator: DoesNotExist}
      - {key: .status.phase, operator: In, values: [Running]}
      - {key: '.metadata.ownerReferences.[].kind', operator: In, values: [Workflow]}
  next:
    statusTemplate: |
      phase: Succeeded
      containerStatuses:
      {{ range .spec.containers }}
      - image: {{ .image | Quote }}
        imageID: {{ .image | Quote }}
        name: {{ .name | Quote }}
        ready: false
        restartCount: 0
        state:
          terminated:
            exitCode: 0
            reason: Completed
            startedAt: {{ Now | Quote }}
            finishedAt: {{ Now | Quote }}
      {{ end }}
"""
"""What kwok does with pods of Jobs, for pods of Workflows."""


def start(cluster: Cluster, namespace: str) -> Daemon:
    """Install Argo Workflows' definitions; start its controller with its default limits."""
    module = gobuild.source(CONTROLLER.module, CONTROLLER.version)
    definitions = sorted((module / "manifests/base/crds/minimal").glob("argoproj.io_*.yaml"))
    for file in definitions:
        cluster.kubectl("apply", "--server-side", f"--filename={file}")
    account = {"apiVersion": "v1", "kind": "ServiceAccount"}
    cluster.apply(
        {
            "apiVersion": "v1",
            "kind": "ConfigMap",
            "metadata": {"name": "workflow-controller-configmap", "namespace": namespace},
        },
        {**account, "metadata": {"name": "argo", "namespace": namespace}},
    )
    authority = controlplane.authority_of(cluster)
    kubeconfig = cluster.folder / "argo.kubeconfig"
    user = authority.issue("argo", USER, group="system:masters")
    write_kubeconfig(kubeconfig, controlplane.INNER_URL, authority.root, user)
    return cluster.bed.spawn(
        "workflow-controller",
        [
            *("/usr/bin/env", "LEADER_ELECTION_DISABLE=true", gobuild.build(CONTROLLER)),
            *("--namespaced", f"--namespace={namespace}", f"--managed-namespace={namespace}"),
            *(f"--kubeconfig={kubeconfig}", "--executor-image=argoexec", "--loglevel=warn"),
        ],
    )


def workflow(
    name: str, namespace: str, items: int, parallelism: int, tolerations: list[Any]
) -> dict[str, Any]:
    """A Workflow of equal pods."""
    container = {"image": "run", "command": ["run"]}
    return {
        "apiVersion": "argoproj.io/v1alpha1",
        "kind": "Workflow",
        "metadata": {"name": name, "namespace": namespace},
        "spec": {
            "entrypoint": "all",
            "serviceAccountName": "argo",
            "parallelism": parallelism,
            "tolerations": tolerations,
            "templates": [
                {
                    "name": "all",
                    "steps": [
                        [{"name": "run", "template": "run", "withSequence": {"count": str(items)}}]
                    ],
                },
                {"name": "run", "container": container},
            ],
        },
    }


class Executor(threading.Thread):
    """Posts what the executor in each pod would: on fake nodes it is not executed."""

    def __init__(self, cluster: Cluster, namespace: str) -> None:
        super().__init__(daemon=True)
        self._requests = Requests(cluster, user="argo-executor")
        self._pods = f"/api/v1/namespaces/{namespace}/pods"
        self._results = RESOURCES.format(namespace, "workflowtaskresults")
        self._seen: set[str] = set()
        self.ended = threading.Event()

    def run(self) -> None:
        try:
            self._post()
        except (OSError, HTTPException):
            if not self.ended.is_set():
                raise

    def _post(self) -> None:
        watch = f"{self._pods}?watch=1&labelSelector={WORKFLOW_LABEL}"
        for event in self._requests.watch(watch):
            pod = event["object"]
            meta = pod["metadata"]
            if pod["status"].get("phase") == "Succeeded" and meta["uid"] not in self._seen:
                self._seen.add(meta["uid"])
                self._requests.post(self._results, _result(meta))


def _result(meta: dict[str, Any]) -> dict[str, Any]:
    labels = {
        WORKFLOW_LABEL: meta["labels"][WORKFLOW_LABEL],
        "workflows.argoproj.io/report-outputs-completed": "true",
    }
    return {
        "apiVersion": "argoproj.io/v1alpha1",
        "kind": "WorkflowTaskResult",
        "metadata": {
            "name": meta["annotations"]["workflows.argoproj.io/node-id"],
            "labels": labels,
        },
        "outputs": {"exitCode": "0"},
    }
