"""A cluster whose Jobs Kueue executes in others: control planes of their own, joined by cables."""

from __future__ import annotations

import base64
import json
import os
import re
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

import yaml
from robovast_testbed import bed, controlplane, kueue, kwok, network
from robovast_testbed.kubernetes import Cluster

from support.kube.operator_process import ROOT, condition, prepare
from support.patience import eventually

API = "kueue.x-k8s.io/v1beta1"
MULTIKUEUE = {"workerLostTimeout": "5s", "gcInterval": "10s"}
"""After what time a worker that does not answer is given up, and how often what a worker need not
do any more is looked for; else 15 min and 1 min."""
EXIT_CODE = "robovast.test/exit-code"
RUN_STAGES = [
    f"""\
apiVersion: kwok.x-k8s.io/v1alpha1
kind: Stage
metadata: {{name: robovast-run}}
spec:
  weight: 1000
  resourceRef: {{apiGroup: v1, kind: Pod}}
  selector:
    matchLabels: {{robovast.io/role: shard}}
    matchExpressions:
      - {{key: .metadata.deletionTimestamp, operator: DoesNotExist}}
      - {{key: .status.phase, operator: In, values: [Running]}}
      - {{key: '.metadata.annotations["{EXIT_CODE}"]', operator: DoesNotExist}}
  delay: {{durationMilliseconds: 3600000}}
  next: {{statusTemplate: 'phase: Running'}}
""",
    f"""\
apiVersion: kwok.x-k8s.io/v1alpha1
kind: Stage
metadata: {{name: robovast-run-ends}}
spec:
  weight: 1000
  resourceRef: {{apiGroup: v1, kind: Pod}}
  selector:
    matchLabels: {{robovast.io/role: shard}}
    matchExpressions:
      - {{key: .metadata.deletionTimestamp, operator: DoesNotExist}}
      - {{key: .status.phase, operator: In, values: [Running]}}
      - {{key: '.metadata.annotations["{EXIT_CODE}"]', operator: Exists}}
  next:
    statusTemplate: |
      {{{{ $code := index .metadata.annotations "{EXIT_CODE}" }}}}
      phase: {{{{ if eq $code "0" }}}}Succeeded{{{{ else }}}}Failed{{{{ end }}}}
      containerStatuses:
        - name: agent
          image: agent
          imageID: agent
          ready: false
          restartCount: 0
          state:
            terminated:
              exitCode: {{{{ $code }}}}
              reason: Ended
              startedAt: {{{{ Now | Quote }}}}
              finishedAt: {{{{ Now | Quote }}}}
""",
]
"""Pods of runs go on until they are told how they end, by an annotation."""


@dataclass(frozen=True)
class Worker:
    """A cluster that executes Jobs for another one."""

    cluster: Cluster
    cable: network.Cable
    """To the manager."""


@dataclass(frozen=True)
class Fleet:
    """A manager with its workers, each on a control plane of its own."""

    manager: Cluster
    workers: dict[str, Worker]

    @property
    def clusters(self) -> list[Cluster]:
        return [self.manager, *(worker.cluster for worker in self.workers.values())]


@contextmanager
def fleet(names: Sequence[str], stages: list[str]) -> Iterator[Fleet]:
    """A manager that knows some workers, with Kueue and fake nodes everywhere.

    Args:
        names: of the workers.
        stages: what fake nodes of the manager make of pods.
    """
    with ExitStack() as stack, ThreadPoolExecutor() as pool:
        beds = [
            stack.enter_context(bed.session(f"pytest-{os.getpid()}-{name}"))
            for name in ("manager", *names)
        ]
        manager, *others = pool.map(with_kueue, beds)
        prepare(manager, 1, stages)
        workers = {}
        for number, (name, worker) in enumerate(zip(names, others, strict=True)):
            kwok.start(worker, 1, stages=RUN_STAGES)
            worker.apply(*queue("own"))
            workers[name] = Worker(worker, network.connect(manager.bed, worker.bed, number))
            manager.apply(access(name, workers[name]))
        yield Fleet(manager, workers)


def with_kueue(own: bed.Bed) -> Cluster:
    """A control plane with Kueue, which gives a silent worker up soon."""
    made = controlplane.start(own)
    kueue.start(made, MULTIKUEUE)
    return made


def documented(page: str = (ROOT / "docs/how-to/multikueue.md").read_text()) -> list[Any]:
    """The objects by which the admin's page leads a queue to the worker `south`."""
    (block,) = re.findall(r"```yaml\n(apiVersion: kueue.*?)```", page, re.DOTALL)
    return list(yaml.safe_load_all(block))


def look_at(manager: Cluster, *kind: str) -> None:
    """Let Kueue look at all objects of a kind now."""
    mark = f"robovast.test/look={uuid4().hex}"
    manager.kubectl("annotate", *kind, "--all", "--overwrite", mark)


def reached(manager: Cluster, worker: str) -> bool:
    """Whether Kueue reaches a worker."""
    found: Any = manager.get("multikueueclusters", worker)
    return condition(found["status"], "Active")["status"] == "True"


def until_reached(manager: Cluster, worker: str) -> None:
    """Wait until Kueue reaches a worker again, for which it would look ever less often."""

    def looked() -> bool:
        look_at(manager, "multikueueclusters")
        return reached(manager, worker)

    eventually(looked, told=lambda: manager.kubectl("get", "multikueueclusters", "--output=yaml"))


def queue(name: str, *checks: str) -> list[dict[str, Any]]:
    """A ClusterQueue that all namespaces may use, and its flavor."""
    quota = [{"name": "cpu", "nominalQuota": "100"}, {"name": "memory", "nominalQuota": "1Ti"}]
    group = {
        "coveredResources": ["cpu", "memory"],
        "flavors": [{"name": "any", "resources": quota}],
    }
    spec = {"namespaceSelector": {}, "resourceGroups": [group], "admissionChecks": checks}
    return [
        {"apiVersion": API, "kind": "ResourceFlavor", "metadata": {"name": "any"}},
        {"apiVersion": API, "kind": "ClusterQueue", "metadata": {"name": name}, "spec": spec},
    ]


def local_queue(name: str, namespace: str, leads_to: str) -> dict[str, Any]:
    """The LocalQueue by which a namespace uses a ClusterQueue."""
    return {
        "apiVersion": API,
        "kind": "LocalQueue",
        "metadata": {"name": name, "namespace": namespace},
        "spec": {"clusterQueue": leads_to},
    }


def access(name: str, worker: Worker) -> dict[str, Any]:
    """The Secret by which Kueue reaches a worker from the manager."""
    flat = worker.cluster.kubectl("config", "view", "--flatten", "--raw", "--output=json")
    config = json.loads(flat)
    config["clusters"][0]["cluster"] |= {
        "server": f"https://{worker.cable.address}:{controlplane.PORT}",
        "tls-server-name": "kubernetes",
    }
    return {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": {"name": name, "namespace": kueue.NAMESPACE},
        "data": {"kubeconfig": base64.b64encode(json.dumps(config).encode()).decode()},
    }
