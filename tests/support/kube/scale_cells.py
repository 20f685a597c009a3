"""One measurement of a campaign's cost to a cluster: its shape, its execution, what it came to."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from robovast_testbed import bed, controlplane, kueue, kwok, node
from robovast_testbed.kubernetes import Cluster

from support.kube import argo_workflows
from support.kube.operator_process import (
    ACCOUNT,
    OperatorProcess,
    campaign,
    finish_stage,
    prepare,
    usage,
    write_requests,
)
from support.kube.requests import METADATA, Requests
from support.patience import eventually

SPACE = "bench"
NODES = 20
SMALL = 20
"""Runs of a small campaign that comes in the middle of a large one."""
LIMITS = {"default": 20, "tuned": 500}
"""Requests that the controller manager may make in a second."""

JOBS = f"/apis/batch/v1/namespaces/{SPACE}/jobs"
CAMPAIGNS = f"/apis/robovast.io/v1beta1/namespaces/{SPACE}/campaigns"
WORKFLOWS = argo_workflows.RESOURCES.format(SPACE, "workflows")
CONTROLLERS = {"ours": ACCOUNT, "argo": argo_workflows.USER}
"""Who makes the write requests that a shape costs beside those of Kubernetes."""


@dataclass(frozen=True)
class Cell:
    """What is measured: so many runs, `pack` in each pod, of one shape."""

    shape: str
    """`ours`, `bare` (one Indexed Job), `jobs` (a Job for each pod) or `argo` (Argo Workflows)."""
    runs: int
    pack: int = 1
    kueue: bool = False
    limits: str = "default"
    failing: bool = False
    """Whether one pod in twenty fails, and the operator is killed and started on the way."""
    behind: bool = False
    """Whether nothing is measured but how long a small campaign waits that comes on the way."""

    @property
    def parallelism(self) -> int:
        """Most pods at once of a campaign: what is default, or enough to keep the cluster busy."""
        return 100 if self.behind else 1000

    @property
    def pods(self) -> int:
        return -(-self.runs // self.pack)

    def __str__(self) -> str:
        parts = [self.shape, str(self.runs), f"by {self.pack}", self.limits]
        marks = {"kueue": self.kueue, "failing": self.failing, "behind": self.behind}
        return " ".join([*parts, *(name for name, set_ in marks.items() if set_)])


@dataclass
class Result:
    """What a cell came to."""

    cell: Cell
    seconds: float = 0
    """From the request that creates it until every run has a verdict."""
    writes: dict[str, int] = field(default_factory=dict)
    """Write requests by user and resource."""
    etcd: int = 0
    """Size of etcd's database [byte]."""
    largest: tuple[str, int] = ("", 0)
    """The largest object and its size as JSON [byte]."""
    own_object: int = 0
    """Size of the Campaign or Workflow at the end [byte]."""
    cpu: float = 0
    """CPU time of the operator or controller [s]."""
    memory: int = 0
    """Its peak memory [byte]."""
    stale: float = 0
    """How long it took at the 99th percentile until a finished pod was in the Campaign [s]."""
    restart: float | None = None
    """From the start of a killed operator until its status was right [s]."""
    behind: float | None = None
    """How long 20 runs took that were asked for in the middle of it until all had started [s]."""
    idle: int | None = None
    """Write requests about a finished campaign in 20 s, the Lease left out."""

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Result:
        found = json.loads(text)
        return cls(**{**found, "cell": Cell(**found["cell"])})

    def written(self, user: str | None = None) -> int:
        """Number of write requests of one user, or of all.

        Of all, heartbeats are left out: fake nodes and managers renew Leases whatever happens.
        """
        if user is None:
            return sum(n for key, n in self.writes.items() if not key.endswith(" leases"))
        return sum(n for key, n in self.writes.items() if key.partition(" ")[0] == user)


def measure(cell: Cell) -> Result:
    """Execute a cell on a control plane of its own."""
    with bed.session(f"scale-{os.getpid()}") as own, TemporaryDirectory() as folder:
        cluster = _cluster(own, cell)
        requests = Requests(cluster, "bench")
        operator = OperatorProcess(cluster, Path(folder))
        with _running(operator):
            template = _template(cell, requests)
            if cell.shape == "ours":
                ours = _Ours(cell, cluster, requests, operator)
                return ours.measure_behind() if cell.behind else ours.measure()
        peer = {"bare": _bare, "jobs": _jobs, "argo": _argo}[cell.shape]
        return peer(cell, cluster, requests, template)


@contextmanager
def _running(operator: OperatorProcess) -> Iterator[None]:
    operator.start()
    try:
        eventually(lambda: "leads" in operator.told(), told=operator.told)
        yield
    finally:
        operator.stop()


def _cluster(own: bed.Bed, cell: Cell) -> Cluster:
    cluster = controlplane.start(own, LIMITS[cell.limits])
    if cell.kueue:
        node.start(cluster)
        kueue.install(cluster)
    totals = {"ours": cell.runs, "sample": cell.pack, "small": SMALL}
    stages = [finish_stage(*campaign) for campaign in totals.items()]
    stages += [argo_workflows.POD_STAGE] if cell.shape == "argo" else []
    stages += [_failing_stage()] if cell.failing else []
    prepare(cluster, NODES, stages, tainted=cell.kueue)
    cluster.kubectl("create", "namespace", SPACE)
    if cell.kueue:
        cluster.apply(*_queue())
    return cluster


def _failing_stage() -> str:
    indexes = [str(index * 20 + index * 7 % 20) for index in range(25)]
    index = '.metadata.annotations["batch.kubernetes.io/job-completion-index"]'
    return f"""\
apiVersion: kwok.x-k8s.io/v1alpha1
kind: Stage
metadata: {{name: robovast-failing}}
spec:
  weight: 1000
  resourceRef: {{apiGroup: v1, kind: Pod}}
  selector:
    matchLabels: {{robovast.io/role: shard}}
    matchExpressions:
      - {{key: .metadata.deletionTimestamp, operator: DoesNotExist}}
      - {{key: .status.phase, operator: In, values: [Running]}}
      - {{key: '{index}', operator: In, values: {json.dumps(indexes)}}}
  next:
    statusTemplate: |
      phase: Failed
      containerStatuses:
      {{{{ range .spec.containers }}}}
      - image: {{{{ .image | Quote }}}}
        name: {{{{ .name | Quote }}}}
        ready: false
        restartCount: 0
        state:
          terminated:
            exitCode: {{{{ if eq .name "agent" }}}}10{{{{ else }}}}0{{{{ end }}}}
            finishedAt: {{{{ Now | Quote }}}}
            reason: Error
            startedAt: {{{{ Now | Quote }}}}
      {{{{ end }}}}
"""


def _queue() -> list[dict[str, Any]]:
    quota = [{"name": name, "nominalQuota": "100000"} for name in ("cpu", "memory")]
    quota[1]["nominalQuota"] = "1000Ti"
    group = {
        "coveredResources": ["cpu", "memory"],
        "flavors": [{"name": "fake", "resources": quota}],
    }
    api = "kueue.x-k8s.io/v1beta1"
    return [
        {"apiVersion": api, "kind": "ResourceFlavor", "metadata": {"name": "fake"}},
        {
            "apiVersion": api,
            "kind": "ClusterQueue",
            "metadata": {"name": "all"},
            "spec": {"namespaceSelector": {}, "resourceGroups": [group]},
        },
        {
            "apiVersion": api,
            "kind": "LocalQueue",
            "metadata": {"name": "queue", "namespace": SPACE},
            "spec": {"clusterQueue": "all"},
        },
    ]


def _campaign(cell: Cell, name: str, runs: int) -> dict[str, Any]:
    """At most 20 runs of each variant."""
    each = min(20, runs)
    toleration = {"key": kwok.TAINT["key"], "operator": "Exists"}
    scheduling = {"nodeSelector": {"type": "kwok"}, "tolerations": [toleration]}
    queue = {"queueName": "queue"} if cell.kueue else {}
    made = campaign(
        name,
        SPACE,
        runs // each,
        each,
        parallelism=cell.parallelism,
        scheduling=scheduling,
        **queue,
    )
    made["spec"]["vast"]["execution"]["runs_per_job"] = cell.pack
    return made


def _template(cell: Cell, requests: Requests) -> Any:
    """The Job of a tiny campaign of ours: peers execute the same pods.

    Our own cells begin with it, too: an operator has its watches long before a campaign comes.
    """
    requests.post(CAMPAIGNS, _campaign(cell, "sample", cell.pack))
    chosen = f"{JOBS}?labelSelector=robovast.io/role=shard"
    job = eventually(lambda: requests.get(chosen)["items"])[0]
    done = f"{CAMPAIGNS}/sample"
    eventually(lambda: requests.get(done).get("status", {}).get("state") == "Finished")
    return job


class _Ours:
    """A Campaign."""

    def __init__(
        self, cell: Cell, cluster: Cluster, requests: Requests, operator: OperatorProcess
    ) -> None:
        self._cell = cell
        self._cluster = cluster
        self._requests = requests
        self._operator = operator
        self._stored: list[tuple[float, int]] = []
        self._told: list[tuple[float, int]] = []
        self._restarted: tuple[float, int] | None = None
        self._usage = (0.0, 0)

    def measure(self) -> Result:
        cell, result = self._cell, Result(self._cell)
        begin = self._cluster.audit_log.stat().st_size
        started = time.monotonic()
        self._requests.post(CAMPAIGNS, _campaign(cell, "ours", cell.runs))
        while self._look() < cell.runs:
            if cell.failing and self._restarted is None and self._told[-1][1] > cell.runs // 3:
                self._restart()
            time.sleep(0.25)
        result.seconds = self._told[-1][0] - started
        result.writes = dict(write_requests(self._cluster, begin))
        eventually(lambda: self._status().get("state") == "Finished")
        result.cpu, result.memory = self._used()
        result.idle = self._idle()
        result.stale = _staleness(self._stored, self._told)
        result.restart = self._caught_up()
        _sizes(result, self._cluster, self._requests, "campaigns.robovast.io")
        return result

    def measure_behind(self) -> Result:
        """How long the runs of a small campaign wait until all have started."""
        cell, result = self._cell, Result(self._cell)
        self._requests.post(CAMPAIGNS, _campaign(cell, "ours", cell.runs))
        while self._look() < cell.runs // 20:
            time.sleep(0.25)
        asked = time.monotonic()
        self._requests.post(CAMPAIGNS, _campaign(cell, "small", SMALL))
        eventually(lambda: self._started("small") >= SMALL, 600)
        result.behind = time.monotonic() - asked
        return result

    def _started(self, name: str) -> int:
        runs = self._status(name).get("runs", {})
        return int(runs.get("active", 0)) + _with_verdict(runs)

    def _status(self, name: str = "ours") -> Any:
        return self._requests.get(f"{CAMPAIGNS}/{name}").get("status", {})

    def _look(self) -> int:
        """The runs with a verdict, as told; also notes what Jobs say."""
        told = _with_verdict(self._status().get("runs", {}))
        self._told.append((time.monotonic(), told))
        if not self._stored or time.monotonic() - self._stored[-1][0] > 1:
            self._stored.append((time.monotonic(), self._finished_pods() * self._cell.pack))
        return told

    def _finished_pods(self) -> int:
        own = "robovast.io/role=shard,robovast.io/campaign=ours"
        chosen = f"{JOBS}?labelSelector={own}&resourceVersion=0"
        states = [job.get("status", {}) for job in self._requests.get(chosen)["items"]]
        return sum(state.get("succeeded", 0) + state.get("failed", 0) for state in states)

    def _restart(self) -> None:
        self._usage = self._operator.usage()
        self._operator.kill()
        time.sleep(20)  # its Lease ends, and pods go on
        self._restarted = (time.monotonic(), self._finished_pods())
        self._operator.start()

    def _caught_up(self) -> float | None:
        if self._restarted is None:
            return None
        since, wanted = self._restarted
        return next(moment for moment, told in self._told if told >= wanted) - since

    def _used(self) -> tuple[float, int]:
        cpu, memory = self._operator.usage()
        return cpu + self._usage[0], max(memory, self._usage[1])

    def _idle(self) -> int:
        time.sleep(6)  # what is written at the very end has been written then
        begin = self._cluster.audit_log.stat().st_size
        time.sleep(20)
        found = write_requests(self._cluster, begin)
        own = {k: n for k, n in found.items() if k.startswith(ACCOUNT) and "leases" not in k}
        return sum(own.values())


def _with_verdict(runs: dict[str, int]) -> int:
    return sum(runs.get(verdict, 0) for verdict in ("passed", "failed", "errored"))


def _staleness(stored: list[tuple[float, int]], told: list[tuple[float, int]]) -> float:
    """How much later than Jobs the Campaign said so, 99th percentile [s]."""
    delays = sorted(
        max(0.0, next((m for m, count in told if count >= number), moment) - moment)
        for moment, number in stored
    )
    return delays[int(len(delays) * 0.99)] if delays else 0.0


def _peer(
    cell: Cell,
    cluster: Cluster,
    requests: Requests,
    create: Callable[[], Any],
    finished: Callable[[], bool],
) -> Result:
    """Jobs that nobody looks after, until the last has finished."""
    result = Result(cell)
    begin = cluster.audit_log.stat().st_size
    started = time.monotonic()
    create()
    while not finished():
        time.sleep(1)
    result.seconds = time.monotonic() - started
    result.writes = dict(write_requests(cluster, begin))
    _sizes(result, cluster, requests, "jobs.batch")
    return result


def _peer_job(cell: Cell, template: Any, name: str, completions: int) -> dict[str, Any]:
    """Pods as a shard has them."""
    kept = {"completionMode", "backoffLimitPerIndex", "podFailurePolicy", "template"}
    spec = {key: value for key, value in template["spec"].items() if key in kept}
    spec["template"]["metadata"] = {"labels": {"peer": "yes"}}
    queue = {"kueue.x-k8s.io/queue-name": "queue"} if cell.kueue else {}
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": {"name": name, "namespace": SPACE, "labels": {"peer": "yes", **queue}},
        "spec": {
            **spec,
            "suspend": cell.kueue,
            "completions": completions,
            "parallelism": min(completions, 1000),
            "maxFailedIndexes": completions,
        },
    }


def _bare(cell: Cell, cluster: Cluster, requests: Requests, template: Any) -> Result:
    job = _peer_job(cell, template, "bare", cell.pods)

    def finished() -> bool:
        return bool(requests.get(f"{JOBS}/bare")["status"].get("succeeded", 0) == cell.pods)

    return _peer(cell, cluster, requests, lambda: requests.post(JOBS, job), finished)


def _jobs(cell: Cell, cluster: Cluster, requests: Requests, template: Any) -> Result:
    def create() -> None:
        for index in range(cell.pods):
            requests.post(JOBS, _peer_job(cell, template, f"run-{index}", 1))

    def finished() -> bool:
        unfinished = f"{JOBS}?labelSelector=peer&fieldSelector=status.successful=0&limit=1"
        return not requests.get(unfinished)["items"]

    return _peer(cell, cluster, requests, create, finished)


def _argo(cell: Cell, cluster: Cluster, requests: Requests, template: Any) -> Result:
    daemon = argo_workflows.start(cluster, SPACE)
    executor = argo_workflows.Executor(cluster, SPACE)
    executor.start()
    tolerations = template["spec"]["template"]["spec"]["tolerations"]
    made = argo_workflows.workflow("peer", SPACE, cell.pods, 1000, tolerations)
    result = Result(cell)
    begin = cluster.audit_log.stat().st_size
    started = time.monotonic()
    requests.post(WORKFLOWS, made)
    phase = argo_workflows.PHASE_LABEL
    while True:
        labels = requests.get(f"{WORKFLOWS}/peer", METADATA)["metadata"].get("labels", {})
        if labels.get(argo_workflows.COMPLETED_LABEL) == "true":
            break
        time.sleep(1)
    result.seconds = time.monotonic() - started
    assert labels[phase] == "Succeeded", f"Argo Workflows says {labels[phase]}"
    executor.ended.set()
    result.writes = dict(write_requests(cluster, begin))
    result.cpu, result.memory = usage(daemon.process.pid)
    _sizes(result, cluster, requests, "workflows.argoproj.io")
    return result


def _sizes(result: Result, cluster: Cluster, requests: Requests, own: str) -> None:
    result.etcd = (cluster.folder / "etcd/member/snap/db").stat().st_size
    group = {"jobs.batch": JOBS, "workflows.argoproj.io": WORKFLOWS}.get(own, CAMPAIGNS)
    owns = [len(json.dumps(item)) for item in requests.get(f"{group}?limit=20")["items"]]
    result.own_object = max(owns)
    maps = requests.get(f"/api/v1/namespaces/{SPACE}/configmaps")["items"]
    jobs = requests.get(f"{JOBS}?limit=20")["items"]
    found = [(own, result.own_object)]
    found += [("configmap", len(json.dumps(item))) for item in maps]
    found += [("job", len(json.dumps(item))) for item in jobs]
    result.largest = max(found, key=lambda pair: pair[1])
