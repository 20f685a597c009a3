"""Argo CD as processes beside a control plane: it syncs Git repositories in folders."""

import json
import os
import tempfile
import urllib.error
import urllib.parse
import urllib.request
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import debian, gobuild, network, programs
from .bed import Daemon
from .commands import run, wait_for
from .kubernetes import Cluster, Manifest

NAMESPACE = "argocd"
REDIS = "127.0.0.1:6379"
REPO_SERVER = "127.0.0.1:8081"
API_PORT = 8080
PROJECT = {
    "apiVersion": "argoproj.io/v1alpha1",
    "kind": "AppProject",
    "metadata": {"name": "default", "namespace": NAMESPACE},
    "spec": {
        "sourceRepos": ["*"],
        "destinations": [{"server": "*", "namespace": "*"}],
        "clusterResourceWhitelist": [{"group": "*", "kind": "*"}],
    },
}


@dataclass(frozen=True)
class ArgoCd:
    """A running Argo CD that lets everybody in."""

    cluster: Cluster
    address: str
    """HOST:PORT of its API server, for programs outside the namespace."""
    controller_log: Path
    """What its controller does, at the level `debug`: one JSON object per line."""

    def application(self, name: str, refresh: bool = False) -> dict[str, Any]:
        """An Application; `refresh` makes Argo CD look into Git first."""
        query = "?refresh=normal" if refresh else ""
        return dict(self._call("GET", f"applications/{name}{query}"))

    def tree(self, name: str) -> list[dict[str, Any]]:
        """All objects of an Application, those that its objects own included."""
        return list(self._call("GET", f"applications/{name}/resource-tree").get("nodes") or [])

    def actions(self, name: str, resource: dict[str, str]) -> dict[str, bool]:
        """Which actions an object has, and which of them can be used now.

        :param resource: `group`, `version`, `kind`, `namespace` and `resourceName`.
        """
        found = self._call(
            "GET", f"applications/{name}/resource/actions?{urllib.parse.urlencode(resource)}"
        )
        return {each["name"]: not each.get("disabled") for each in found.get("actions") or []}

    def run_action(self, name: str, resource: dict[str, str], action: str) -> None:
        """Do what a click on an action does."""
        path = f"applications/{name}/resource/actions/v2"
        self._call("POST", path, resource | {"action": action})

    def _call(self, method: str, path: str, body: object = None) -> Any:
        request = urllib.request.Request(
            f"http://{self.address}/api/v1/{path}",
            method=method,
            data=None if body is None else json.dumps(body).encode(),
            headers={"Content-Type": "application/json"},
        )
        with urllib.request.urlopen(request, timeout=30) as answer:  # noqa: S310 - of http alone
            return json.loads(answer.read() or b"{}")


def start(cluster: Cluster, customizations: Path) -> ArgoCd:
    """Start Argo CD on a control plane and wait until it takes Applications.

    :param customizations: a manifest with additions to its ConfigMap `argocd-cm`.
    :raises Unavailable: when the machine cannot build it.
    :raises StartFailed: when it does not answer in time.
    """
    debian.require("redis-server")
    program = gobuild.build(programs.ARGOCD)
    manifests = gobuild.source(programs.ARGOCD.module, programs.ARGOCD.version) / "manifests"
    _install(cluster, manifests, customizations)
    bed, folder = cluster.bed, cluster.bed.folder / "argocd"
    for name in ("redis", "tmp", "ssh", "tls"):
        (folder / name).mkdir(parents=True)
    env = {
        "PATH": f"{gobuild.build(programs.HELM).parent}:{os.environ['PATH']}",
        "KUBECONFIG": str(cluster.inner_kubeconfig),
        "ARGOCD_FAKE_IN_CLUSTER": "true",
        "ARGOCD_GPG_ENABLED": "false",
        "ARGOCD_SSH_DATA_PATH": str(folder / "ssh"),
        "ARGOCD_TLS_DATA_PATH": str(folder / "tls"),
        "TMPDIR": str(folder / "tmp"),
    }

    def spawn(name: str, *arguments: str) -> Daemon:
        own = env | {"ARGOCD_BINARY_NAME": f"argocd-{name}"}
        return bed.spawn(f"argocd-{name}", [program, "--redis", REDIS, *arguments], env=own)

    host, _, port = REDIS.partition(":")
    bed.spawn(
        "redis",
        ["redis-server", "--bind", host, "--port", port, "--save", "", "--dir", folder / "redis"],
    )
    spawn("repo-server", "--disable-tls")
    to_repositories = ("--repo-server", REPO_SERVER, "--repo-server-plaintext")
    of_cluster = (f"--namespace={NAMESPACE}", *to_repositories)
    controller = spawn("application-controller", *of_cluster, "--loglevel=debug")
    server = spawn("server", *of_cluster, "--insecure", "--disable-auth", f"--port={API_PORT}")
    argo = ArgoCd(cluster, f"127.0.0.1:{network.publish(bed, API_PORT)}", controller.log)
    wait_for("argocd-server", lambda: _answers(argo), failed=server.failure)
    return argo


def health(obj: Manifest, customizations: Path) -> tuple[str, str]:
    """What Argo CD says of an object's health, without any cluster: status and message.

    :param customizations: a manifest of `argocd-cm`.
    """
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump(obj, file)
        file.flush()
        answer = run(
            [
                *(gobuild.build(programs.ARGOCD), "admin", "settings", "resource-overrides"),
                *("health", file.name, "--argocd-cm-path", customizations),
            ],
            env=os.environ | {"ARGOCD_BINARY_NAME": "argocd"},
        )
    status, message = (line.partition(": ")[2] for line in answer.splitlines())
    return status, message


def _install(cluster: Cluster, manifests: Path, customizations: Path) -> None:
    crds = list((manifests / "crds").glob("app*-crd.yaml"))
    settings = (manifests / "base/config").glob("argocd-*.yaml")
    apply = ("apply", "--server-side", f"--namespace={NAMESPACE}")
    cluster.kubectl("create", "namespace", NAMESPACE)
    cluster.kubectl(*apply, *(f"--filename={file}" for file in (*crds, *settings)))
    cluster.kubectl(*apply, "--field-manager=robovast", f"--filename={customizations}")
    wait_for("argocd", lambda: _knows(cluster, len(crds)), failed=lambda: None)
    cluster.apply(PROJECT)


def _knows(cluster: Cluster, kinds: int) -> bool:
    served = cluster.kubectl("api-resources", "--api-group=argoproj.io", "--output=name")
    return len(served.split()) == kinds


def _answers(argo: ArgoCd) -> bool:
    try:
        argo._call("GET", "applications")
    except (urllib.error.URLError, OSError):
        return False
    return True
