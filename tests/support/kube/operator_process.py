"""The operator as a process of its own, with the rights that the chart gives it."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
import yaml
from robovast_testbed import clocks, kwok
from robovast_testbed.helm import helm
from robovast_testbed.kubernetes import Cluster
from robovast_testbed.outages import Process

from support.kube.definitions import await_definitions

ROOT = Path(__file__).parents[3]
SYSTEM = "robovast-system"
ACCOUNT = f"system:serviceaccount:{SYSTEM}:robovast-operator"

FINISH_STAGE = """\
apiVersion: kwok.x-k8s.io/v1alpha1
kind: Stage
metadata: {{name: robovast-finish-{campaign}}}
spec:
  weight: 1000
  resourceRef: {{apiGroup: v1, kind: Pod}}
  selector:
    matchLabels: {{robovast.io/role: finish, robovast.io/campaign: {campaign}}}
    matchExpressions:
      - {{key: .metadata.deletionTimestamp, operator: DoesNotExist}}
      - {{key: .status.phase, operator: In, values: [Pending, Running]}}
  next:
    statusTemplate: |
      phase: Succeeded
      containerStatuses:
        - name: finish
          image: finish
          imageID: finish
          ready: false
          restartCount: 0
          state:
            terminated:
              exitCode: 0
              reason: Completed
              message: '{message}'
              startedAt: "2026-01-01T00:00:00Z"
              finishedAt: "2026-01-01T00:00:00Z"
"""
"""On fake nodes nothing runs: what the finish Job would find is said by its pod's fake."""


def finish_stage(campaign: str, total: int) -> str:
    """The Stage in which all runs have passed."""
    message = json.dumps({"total": total, "passed": total, "failed": 0, "errored": 0})
    return FINISH_STAGE.format(campaign=campaign, message=message)


def needed_stages(campaign: str, variants: int, most: int, needed: int) -> list[str]:
    """The Stages of a campaign each of whose variants passes in as many runs as are needed."""
    said = {"passed": "", "failed": "", "errored": "", "counts": [needed, 0, 0]}
    spared = most - needed
    counts = {"total": variants * most, "passed": variants * needed, "failed": 0, "errored": 0}
    told = f"{variants} passing after {needed}"
    summary = {**counts, "notNeeded": variants * spared, "decisions": told}
    run = FINISH_STAGE.replace("finish", "shard").replace("name: shard\n", "name: agent\n")
    words = {FINISH_STAGE: summary, run: {**said, "notNeeded": spared}}
    return [t.format(campaign=campaign, message=json.dumps(w)) for t, w in words.items()]


def measured_stages(campaign: str, total: int) -> list[str]:
    """The Stages of a campaign whose pods say that a run took 2 s, and all of them 22 s."""
    said = {"passed": "", "failed": "", "errored": "", "executed": 1, "seconds": 2.0}
    run = FINISH_STAGE.replace("finish", "shard").replace("name: shard\n", "name: agent\n")
    run = run.replace("shardedAt", "finishedAt").replace(
        'finishedAt: "2026-01-01T00:00:00Z"', 'finishedAt: "2026-01-01T00:00:22Z"'
    )
    run = run.replace(
        "phase: Succeeded\n", 'phase: Succeeded\n      startTime: "2026-01-01T00:00:00Z"\n'
    )
    return [
        finish_stage(campaign, total),
        run.format(campaign=campaign, message=json.dumps(said)),
    ]


def failing_stages(campaign: str, total: int) -> list[str]:
    """The Stages of a campaign all of whose runs fail, and whose pods say why."""
    bad = [{"run": "one-1/0", "verdict": "failed", "reason": "goal not reached"}]
    said = {"passed": "", "failed": "", "errored": "", "counts": [0, 1, 0], "bad": bad}
    counts = {"total": total, "passed": 0, "failed": total, "errored": 0}
    run = FINISH_STAGE.replace("finish", "shard").replace("name: shard\n", "name: agent\n")
    run = run.replace("shardedAt", "finishedAt").replace("phase: Succeeded", "phase: Failed")
    run = run.replace("exitCode: 0", "exitCode: 10")
    words = {FINISH_STAGE: counts, run: said}
    return [t.format(campaign=campaign, message=json.dumps(w)) for t, w in words.items()]


def proposal_stages(campaign: str, words: Sequence[Mapping[str, Any]]) -> list[str]:
    """The Stages of a search's propose Jobs, whose words are given, the first one's first."""
    stages = []
    for number, said in enumerate(words):
        text = FINISH_STAGE.replace("finish", "propose")
        stage = yaml.safe_load(text.format(campaign=campaign, message=json.dumps(said)))
        stage["metadata"]["name"] += f"-{number}"
        job = '.metadata.labels["batch.kubernetes.io/job-name"] | sub("^.*-propose-"; "")'
        wanted = {"key": job, "operator": "In", "values": [str(number)]}
        stage["spec"]["selector"]["matchExpressions"].append(wanted)
        stages.append(yaml.safe_dump(stage))
    return stages


def prepare(cluster: Cluster, nodes: int, stages: list[str], *, tainted: bool = False) -> None:
    """Fake nodes, the resource definitions, and the operator's account with the chart's rights."""
    kwok.start(cluster, nodes, stages=stages, tainted=tainted)
    cluster.kubectl("create", "namespace", SYSTEM)
    rendered = helm(
        cluster,
        *("template", "robovast", ROOT / "helm/robovast", "--namespace", SYSTEM),
        *("--kube-version", "1.36.0"),
    )
    wanted = {"CustomResourceDefinition", "ServiceAccount", "ClusterRole", "ClusterRoleBinding"}
    objects = [obj for obj in yaml.safe_load_all(rendered) if obj]
    rights = [o for o in objects if o["kind"] in wanted | {"Role", "RoleBinding"}]
    text = yaml.safe_dump_all(rights)
    cluster.kubectl("--namespace", SYSTEM, "apply", "--server-side", "-f", "-", stdin=text)
    await_definitions(cluster)


HELD_STAGE = """\
apiVersion: kwok.x-k8s.io/v1alpha1
kind: Stage
metadata: {{name: robovast-held-{campaign}}}
spec:
  weight: 1000
  resourceRef: {{apiGroup: v1, kind: Pod}}
  selector:
    matchLabels: {{robovast.io/role: shard, robovast.io/campaign: {campaign}}}
    matchExpressions:
      - {{key: .metadata.deletionTimestamp, operator: DoesNotExist}}
      - {{key: .metadata.labels.go, operator: DoesNotExist}}
      - {{key: .status.phase, operator: In, values: [Running]}}
  delay: {{durationMilliseconds: 36000000}}
  next: {{}}
"""
"""The pods of a campaign whose runs go on until each gets the label `go`."""


FINISHED = {
    "many": 200, "few": 6, "hunted": 300, "seek": 17, "more": 17,
    "busy": 10, "stopped": 4, "waiting": 4, "newer": 4,
}  # fmt: skip
"""Runs of the campaigns that come to their end on fake nodes, by name."""


DIGEST = "ab" * 32
SAID: list[dict[str, Any]] = [
    {"blocks": [[0, 4, 0, 2]], "variants": 4, "digest": DIGEST},
    {"blocks": [[4, 4, 0, 2], [1, 1, 2, 1]], "variants": 4, "digest": DIGEST, "batch": 1,
     "evaluated": 4, "best": "failure_rate 0.5", "criteria": "batches 1/2"},
    {"blocks": [], "digest": DIGEST, "batch": 2, "evaluated": 8, "best": "failure_rate 1",
     "criteria": "batches 2/2", "stop": "batches", "stopReason": "batches: batches 2/2"},
]  # fmt: skip
PROPOSED = {
    "seek": SAID,
    "odd": [SAID[0], {**SAID[1], "blocks": [[0, 1, 0, 1]]}],
    "more": [*SAID, {**SAID[2], "criteria": "batches 2/3", "stop": "exhausted"}],
}
"""What the propose Jobs of searches say on fake nodes, by name; `odd` asks for runs twice, `more`
is asked again when it has ended."""


@pytest.fixture(scope="session")
def fake_cluster(control_plane: Cluster) -> Cluster:
    """A control plane with fake nodes on which pods end at once."""
    stages = [finish_stage(*campaign) for campaign in FINISHED.items()]
    stages += [s for campaign in PROPOSED.items() for s in proposal_stages(*campaign)]
    stages += needed_stages("needed", 3, 50, 18)
    stages += measured_stages("measured", 300)
    stages += failing_stages("sour", 60)
    stages.append(HELD_STAGE.format(campaign="busy"))
    prepare(control_plane, 4, stages)
    return control_plane


@pytest.fixture
def namespace(fake_cluster: Cluster) -> Iterator[str]:
    """A namespace of the test's own."""
    name = f"lab-{uuid4().hex[:6]}"
    fake_cluster.kubectl("create", "namespace", name)
    yield name
    fake_cluster.kubectl("delete", "namespace", name, "--wait=false")


class OperatorProcess:
    """An operator that can be killed and started."""

    def __init__(
        self,
        cluster: Cluster,
        folder: Path,
        name: str = "one",
        *,
        server: str | None = None,
        **settings: str,
    ) -> None:
        self._cluster = cluster
        self._server = server
        self._folder = folder
        self._name = name
        self._settings = settings
        self._process: subprocess.Popen[bytes] | None = None
        self.log = folder / f"{name}.log"

    def start(self) -> None:
        token = self._cluster.kubectl(
            *("--namespace", SYSTEM, "create", "token", "robovast-operator", "--duration=1h")
        )
        config = yaml.safe_load(self._cluster.kubeconfig.read_text())
        config["users"][0]["user"] = {"token": token.strip()}
        if self._server is not None:
            config["clusters"][0]["cluster"] = {"server": self._server}
        path = self._folder / f"{self._name}.kubeconfig"
        path.write_text(yaml.safe_dump(config))
        environment = {
            **{k: v for k, v in os.environ.items() if not k.startswith("ROBOVAST")},
            "KUBECONFIG": str(path),
            "ROBOVAST_AGENT_IMAGE": "agent",
            "ROBOVAST_S3_ENDPOINT": "http://127.0.0.1:9",
            "ROBOVAST_PORT": "0",
            "POD_NAMESPACE": SYSTEM,
            "POD_NAME": self._name,
            **self._settings,
        }
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "robovast_operator"],
                env=environment,
                stdout=log,
                stderr=log,
            )

    def kill(self) -> None:
        """`kill -9`."""
        assert self._process is not None
        self._process.kill()
        self._process.wait()

    def told(self) -> str:
        """Its log so far."""
        return self.log.read_text() if self.log.exists() else ""

    def signal(self, number: int) -> None:
        """Send a signal: SIGSTOP pauses it, SIGCONT lets it go on."""
        assert self._process is not None
        self._process.send_signal(number)

    @contextmanager
    def shifted(self, seconds: int) -> Iterator[None]:
        """Let it see another time of day."""
        assert self._process is not None
        with clocks.shifted(Process(self._process.pid, ()), seconds):
            yield

    def memory(self) -> int:
        """Memory that it occupies now [byte]."""
        assert self._process is not None
        pages = Path(f"/proc/{self._process.pid}/statm").read_text().split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE")

    def stop(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            self._process.wait(timeout=180)

    @property
    def alive(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def usage(self) -> tuple[float, int]:
        """CPU time so far [s] and peak memory [byte]."""
        assert self._process is not None
        return usage(self._process.pid)


NewOperator = Callable[..., OperatorProcess]
"""Its arguments: the name of the operator, and settings beside those of its namespace."""


@pytest.fixture
def new_operator(fake_cluster: Cluster, namespace: str, tmp_path: Path) -> Iterator[NewOperator]:
    """Makes operators for the test's namespace, since other tests leave Campaigns in theirs.

    However the test ends, none of them outlives it: it would go on to lead, and no later one
    would do anything.
    """
    made: list[OperatorProcess] = []

    def make(name: str = "one", *, server: str | None = None, **settings: str) -> OperatorProcess:
        defaults = {"ROBOVAST_LEASE_SECONDS": "2", "ROBOVAST_NAMESPACES": namespace}
        operator = OperatorProcess(
            fake_cluster, tmp_path, name, server=server, **{**defaults, **settings}
        )
        made.append(operator)
        return operator

    yield make
    for operator in made:
        operator.stop()
    for operator in made:
        assert "a fault of the operator" not in operator.told(), operator.told()
        assert "Traceback" not in operator.told(), operator.told()


def usage(pid: int) -> tuple[float, int]:
    """CPU time of a process so far [s] and its peak memory [byte]."""
    stat = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    ticks = int(stat[11]) + int(stat[12])
    status = Path(f"/proc/{pid}/status").read_text()
    peak = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return ticks / os.sysconf("SC_CLK_TCK"), int(peak.split()[1]) * 1024


def write_requests(cluster: Cluster, since: int = 0, namespace: str = "") -> Counter[str]:
    """Write requests by "USER RESOURCE", from the audit log.

    `since` is an offset in it; with `namespace`, only those about objects in there.
    """
    found: Counter[str] = Counter()
    with cluster.audit_log.open("rb") as file:
        file.seek(since)
        for line in file:
            entry = json.loads(line)
            about = entry.get("objectRef", {})
            done = entry.get("stage") == "ResponseComplete"
            chosen = not namespace or about.get("namespace") == namespace
            if done and chosen and entry["verb"] in {"create", "update", "patch", "delete"}:
                parts = (about.get("resource", "-"), about.get("subresource", ""))
                found[f"{entry['user']['username']} {'/'.join(filter(None, parts))}"] += 1
    return found


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def page(port: int, name: str) -> str:
    """One of the operator's own pages; empty while it does not answer."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/{name}", timeout=10) as answer:
            return str(answer.read().decode())
    except OSError:
        return ""


def created(cluster: Cluster, namespace: str, kind: str) -> Counter[str]:
    """How often objects were created, by name, as the audit log tells."""
    found: Counter[str] = Counter()
    for line in cluster.audit_log.read_text().splitlines():
        if f'"namespace":"{namespace}"' not in line or '"verb":"create"' not in line:
            continue
        entry = json.loads(line)
        about = entry["objectRef"]
        done = entry["stage"] == "ResponseComplete" and entry["responseStatus"]["code"] == 201
        if done and about["resource"] == kind and "subresource" not in about:
            found[about.get("name", "")] += 1
    return found


def campaign(
    name: str, namespace: str, variants: int, runs: int | dict[str, Any], **spec: Any
) -> dict[str, Any]:
    """A Campaign for fake nodes."""
    vast = {
        "version": 1,
        "configuration": [
            {
                "name": "one",
                "variations": [
                    {"ParameterVariationList": {"name": "x", "values": list(range(variants))}}
                ],
            }
        ],
        "execution": {"image": "fake", "scenario_file": "scenario.osc", "runs": runs},
    }
    scenario = "scenario try_it:\n    x: int = 1\n    do serial:\n        wait elapsed(1s)\n"
    return {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Campaign",
        "metadata": {"name": name, "namespace": namespace},
        "spec": {"vast": vast, "source": {"inline": {"files": {"scenario.osc": scenario}}}, **spec},
    }


def heavy(name: str, namespace: str, values: int, parameters: int) -> dict[str, Any]:
    """A Campaign with `values ** 3` variants, each of so many parameters."""
    obj = campaign(name, namespace, 1, 1, suspend=True)
    names = [f"p{number}" for number in range(parameters)]
    obj["spec"]["vast"]["configuration"] = [
        {
            "name": "one",
            "variations": [
                {"ParameterVariationList": {"name": name, "values": list(range(values))}}
                for name in names[:3]
            ],
        }
    ]
    declared = "".join(f'    {name}: string = "{"x" * 50}"\n' for name in names)
    scenario = f"scenario try_it:\n{declared}    do serial:\n        wait elapsed(1s)\n"
    obj["spec"]["source"]["inline"]["files"]["scenario.osc"] = scenario
    return obj


def status(cluster: Cluster, namespace: str, name: str) -> dict[str, Any]:
    found: Any = cluster.get("campaign", name, f"--namespace={namespace}")
    return dict(found.get("status") or {})


def condition(state: dict[str, Any], name: str) -> dict[str, str]:
    return next((c for c in state.get("conditions", []) if c["type"] == name), {})


def finished(cluster: Cluster, namespace: str, name: str) -> bool:
    """Whether a Campaign has come to its end."""
    state = status(cluster, namespace, name)
    return condition(state, "ResultsAvailable").get("status") == "True"
