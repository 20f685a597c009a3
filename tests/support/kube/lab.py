"""RoboVAST installed on a real cluster by its own chart, and a namespace for each test."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from uuid import uuid4

import pytest
from robovast_testbed import bed, containerd, controlplane, images, node
from robovast_testbed.errors import StartFailed
from robovast_testbed.helm import helm
from robovast_testbed.kubernetes import Cluster
from robovast_testbed.pytest_plugin import skipped_when_unavailable

from robovast.kubeapi.submission import SubmitOptions, prepare_submission
from robovast.model.document import load_document
from support.campaigns.local import make_campaign

ROOT = Path(__file__).parents[3]
VAST = Path(sys.executable).with_name("vast")
SYSTEM = "robovast-system"

BOOKKEEPING = re.compile(r"\.imported|_execution/|_transient/(owner\.json|variants|bad-runs-)")
"""What a download or a bucket says of itself: whose it is, what is to be run, what to repeat."""

QUICK = """\
version: 1
metadata: {name: quick}
configuration:
- name: one
  variations:
  - ParameterVariationList: {name: x, values: [1, 2, 3]}
execution:
  scenario_file: scenario.osc
  run_files: ['files/*']
"""


EMBEDDED = {
    "storage.embedded.image": images.S3,
    "storage.embedded.size": "1Gi",
    "page.enabled": "true",
    "page.every": "6",
}
"""Values of the chart for its own S3 server, with the page of its buckets."""


def install(cluster: Cluster, given: Mapping[str, str] = EMBEDDED) -> None:
    """Install RoboVAST by its chart, with an S3 server unless values say otherwise."""
    containerd.of(cluster.bed).load(images.agent_archive())
    label = {"pod-security.kubernetes.io/enforce": "restricted"}
    metadata = {"name": SYSTEM, "labels": label}
    cluster.apply({"apiVersion": "v1", "kind": "Namespace", "metadata": metadata})
    install_chart(cluster, ROOT / "helm/robovast", given)


def install_chart(
    cluster: Cluster, chart: Path, given: Mapping[str, str] = EMBEDDED, *files: Path
) -> None:
    """Install or upgrade from a chart, with images that the cluster's node has.

    Args:
        cluster: to install in.
        chart: the chart.
        given: further values.
        files: files with further values.
    """
    values = {
        "operator.image": images.AGENT,
        "agent.image": images.AGENT,
        "example.image": images.SLIM,
        "policies.reuseNamespaces": "{*}",
        **given,
    }
    words = [word for name, value in values.items() for word in ("--set", f"{name}={value}")]
    helm(
        cluster,
        *("upgrade", "--install", "robovast", chart, "--namespace", SYSTEM),
        *("--wait", "--timeout", "5m", *words, *(f"--values={path}" for path in files)),
    )


def copy_credentials(cluster: Cluster, namespace: str) -> None:
    """Give a namespace the storage's Secret."""
    secret = json.loads(
        cluster.kubectl(
            *("--namespace", SYSTEM, "get", "secret", "robovast-storage", "--output=json")
        )
    )
    copy = {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": {"name": "robovast-storage", "namespace": namespace},
        "data": secret["data"],
    }
    cluster.kubectl("apply", "--filename=-", stdin=json.dumps(copy))


@pytest.fixture(scope="session")
def installed(cluster: Cluster) -> Cluster:
    """A cluster in which `helm install` has installed RoboVAST."""
    with skipped_when_unavailable():
        install(cluster)
    return cluster


@dataclass
class Lab:
    """A namespace in which campaigns can be run."""

    cluster: Cluster
    namespace: str
    folder: Path
    env: dict[str, str] = field(default_factory=dict)

    def kubectl(self, *arguments: str | Path, stdin: str | None = None) -> str:
        return self.cluster.kubectl("--namespace", self.namespace, *arguments, stdin=stdin)

    def vast(self, *arguments: object, code: int | None = 0) -> subprocess.CompletedProcess[str]:
        """Run `vast` as a user does, with the cluster's kubeconfig."""
        words = [VAST, *map(str, arguments)]
        env = {**os.environ, **self.env, "COLUMNS": "200"}
        done = subprocess.run(
            words, cwd=self.folder, env=env, capture_output=True, text=True, timeout=400,
            check=False,
        )  # fmt: skip
        assert code is None or done.returncode == code, done.stdout + done.stderr
        return done

    def get(self, kind: str, *arguments: str) -> Any:
        return json.loads(self.kubectl("get", kind, *arguments, "--output=json"))

    def campaign(self, name: str) -> dict[str, Any]:
        found: dict[str, Any] = self.get("campaign", name)
        return found

    def conditions(self, name: str) -> dict[str, dict[str, str]]:
        status = self.campaign(name).get("status", {})
        return {item["type"]: item for item in status.get("conditions", [])}

    def wait(self, name: str, condition: str = "ResultsAvailable", seconds: int = 240) -> None:
        """Wait as a script does; what went wrong is in the message."""
        try:
            self.kubectl(
                *("wait", f"campaign/{name}", f"--for=condition={condition}"),
                f"--timeout={seconds}s",
            )
        except StartFailed as error:
            raise AssertionError(self.describe(name)) from error

    def describe(self, name: str) -> str:
        """All that a person would look at."""
        texts = [json.dumps(self.campaign(name).get("status"), indent=1)]
        texts.append(self.kubectl("get", "jobs,pods,events", "--output=wide"))
        log = ("logs", "deployment/robovast-operator", "--tail=30")
        try:
            texts.append(self.cluster.kubectl("--namespace", SYSTEM, *log))
        except StartFailed as error:  # the kubelet, which gives logs, may be what a test stops
            texts.append(str(error))
        return "\n".join(texts)

    def apply(self, vast: Path, name: str, **spec: Any) -> dict[str, Any]:
        """Apply the Campaign of a document, with its files inline, as kubectl users do."""
        made = self.prepared(vast, name)
        obj = {**made, "spec": {**made["spec"], **spec}}
        self.kubectl("apply", "--filename=-", stdin=json.dumps(obj))
        return obj

    def prepared(self, vast: Path, name: str, image: str = images.SLIM) -> dict[str, Any]:
        """The Campaign of a document."""
        options = SubmitOptions(image=image)
        return prepare_submission(load_document(vast), options, name, self.namespace).campaign

    def quick(self, name: str, script: str, extra: str = "", **spec: Any) -> Path:
        """Apply a campaign whose runs execute a script; returns its document."""
        path = make_campaign(self.folder / name, script, extra, QUICK)
        self.apply(path, name, **spec)
        return path

    def download(self, name: str) -> Path:
        """The results of a campaign, brought home."""
        target = self.folder / "home"
        self.vast("results", "download", "-n", self.namespace, "-i", name, "-o", target)
        return target / str(self.campaign(name)["status"]["campaign"])

    def verdicts(self, folder: Path) -> dict[str, str]:
        """Verdict by run, as the results say."""
        found = {}
        for path in sorted(folder.glob("*/*/run.json")):
            record = json.loads(path.read_text())
            found[f"{record['variant']}/{record['run']}"] = record["verdict"]
        return found


def make_lab(cluster: Cluster, name: str, folder: Path) -> Lab:
    """A new namespace with credentials of the storage."""
    cluster.kubectl("create", "namespace", name)
    copy_credentials(cluster, name)
    return Lab(cluster, name, folder, cluster.env)


@contextmanager
def bench_lab(name: str) -> Iterator[Lab]:
    """A real node of a benchmark's own, with RoboVAST installed by its chart."""
    with bed.session(f"{name}-{os.getpid()}") as own, TemporaryDirectory() as folder:
        cluster = controlplane.start(own)
        node.start(cluster, [images.archive()])
        install(cluster)
        yield make_lab(cluster, name, Path(folder))


@pytest.fixture
def lab(installed: Cluster, tmp_path: Path) -> Iterator[Lab]:
    """A namespace of the test's own, with credentials of the storage."""
    name = f"lab-{uuid4().hex[:6]}"
    yield make_lab(installed, name, tmp_path)
    installed.kubectl("delete", "namespace", name, "--wait=false")


def fill_claim(lab: Lab, name: str, command: str, size: str = "1Mi") -> None:
    """A claim of a volume that campaigns may read, with what a shell command leaves in it."""
    label = {"robovast.io/assets": "true"}
    claim = {
        "apiVersion": "v1",
        "kind": "PersistentVolumeClaim",
        "metadata": {"name": name, "namespace": lab.namespace, "labels": label},
        "spec": {"accessModes": ["ReadWriteOnce"], "resources": {"requests": {"storage": size}}},
    }
    container = {
        "name": "fill",
        "image": images.SLIM,
        "command": ["sh", "-c", command],
        "workingDir": "/assets",
        "volumeMounts": [{"name": "assets", "mountPath": "/assets"}],
    }
    pod = {
        "apiVersion": "v1",
        "kind": "Pod",
        "metadata": {"name": f"fill-{name}", "namespace": lab.namespace},
        "spec": {
            "restartPolicy": "Never",
            "containers": [container],
            "volumes": [{"name": "assets", "persistentVolumeClaim": {"claimName": name}}],
        },
    }
    for made in (claim, pod):
        lab.kubectl("create", "--filename=-", stdin=json.dumps(made))
    succeeded = "--for=jsonpath={.status.phase}=Succeeded"
    lab.kubectl("wait", f"pod/fill-{name}", succeeded, "--timeout=180s")


@contextmanager
def own_operator(lab: Lab) -> Iterator[Callable[[], None]]:
    """An operator of the test's own in place of the installed one; call to kill and restart it."""
    deployment = ("--namespace", SYSTEM, "scale", "deployment/robovast-operator")
    lab.cluster.kubectl(*deployment, "--replicas=0")
    lab.cluster.kubectl(
        *("--namespace", SYSTEM, "wait", "pod", "--selector=app=robovast-operator"),
        *("--for=delete", "--timeout=180s"),
    )
    environment = {
        **os.environ,
        **lab.env,
        "ROBOVAST_AGENT_IMAGE": images.AGENT,
        "ROBOVAST_S3_ENDPOINT": f"http://robovast-s3.{SYSTEM}.svc:9000",
        "ROBOVAST_PORT": "0",
        "ROBOVAST_LEASE_SECONDS": "2",
        "ROBOVAST_STATUS_SECONDS": "1",
        "POD_NAMESPACE": lab.namespace,
        "POD_NAME": "same",
    }
    processes: list[subprocess.Popen[bytes]] = []
    log = (lab.folder / "operator.log").open("ab")

    def restart() -> None:
        if processes:
            processes[-1].kill()
            processes[-1].wait()
        command = [sys.executable, "-m", "robovast_operator"]
        processes.append(subprocess.Popen(command, env=environment, stdout=log, stderr=log))

    restart()
    try:
        yield restart
    finally:
        processes[-1].terminate()
        processes[-1].wait(timeout=180)
        log.close()
        lab.cluster.kubectl(*deployment, "--replicas=1")
        lab.cluster.kubectl(
            *("--namespace", SYSTEM, "rollout", "status", "deployment/robovast-operator"),
            "--timeout=180s",
        )


def files(campaign: Path) -> set[str]:
    """Every file and link of a campaign that does not depend on when, where or how it was run."""
    found = (path.relative_to(campaign).as_posix() for path in campaign.rglob("*"))
    return {name for name in found if not BOOKKEEPING.match(name)}


def buckets(lab: Lab) -> list[str]:
    """The buckets of the installation's own S3 server."""
    listed = ("exec", "robovast-s3-0", "--", "ls", "/data/buckets")
    return lab.cluster.kubectl("--namespace", SYSTEM, *listed).split()
