"""A running cluster, as tests see it."""

import json
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from . import api_reads, pki, programs
from .bed import Bed
from .commands import run

Manifest = Mapping[str, object]


@dataclass(frozen=True)
class Cluster:
    """A cluster whose API server answers on the machine's loopback."""

    bed: Bed

    @property
    def folder(self) -> Path:
        """Return the folder of the cluster's files."""
        return self.bed.folder / "kubernetes"

    @property
    def kubeconfig(self) -> Path:
        """Return the administrator's kubeconfig, for programs outside the namespace."""
        return self.folder / "admin.kubeconfig"

    @property
    def inner_kubeconfig(self) -> Path:
        """Return the administrator's kubeconfig for programs inside the namespace."""
        return self.folder / "inner.kubeconfig"

    @property
    def env(self) -> dict[str, str]:
        """Return the variables that lead a Kubernetes client to this cluster."""
        return {"KUBECONFIG": str(self.kubeconfig)}

    @property
    def audit_log(self) -> Path:
        """Return the log of all requests to the API server: one JSON object per line."""
        return self.bed.folder / "logs" / "audit.log"

    def kubectl(self, *arguments: str | Path, stdin: str | None = None) -> str:
        """Run a kubectl command to its end; return its standard output."""
        return run([*self._kubectl, *arguments], stdin=stdin)

    @contextmanager
    def watching(self, *arguments: str, seconds: float = 60) -> Iterator[Iterator[str]]:
        """Start `kubectl get --watch ARGUMENTS`, for the lines that it shows within `seconds`."""
        command = ["timeout", str(seconds), *self._kubectl, "get", "--watch", *arguments]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            try:
                yield (line.rstrip("\n") for line in process.stdout)
            finally:
                process.kill()

    @property
    def _kubectl(self) -> tuple[str | Path, ...]:
        return (programs.kubectl(), f"--kubeconfig={self.kubeconfig}")

    def apply(self, *objects: Manifest) -> None:
        """Create or change objects by server-side apply."""
        items = {"apiVersion": "v1", "kind": "List", "items": objects}
        self.kubectl("apply", "--server-side", "--filename=-", stdin=json.dumps(items))

    def get(self, *arguments: str) -> dict[str, object]:
        """Return what `kubectl get ARGUMENTS` shows, parsed."""
        found = api_reads.read(self.kubeconfig, arguments)
        if found is not None:
            return found
        answer: dict[str, object] = json.loads(self.kubectl("get", *arguments, "--output=json"))
        return answer


def write_kubeconfig(path: Path, server: str, root: pki.Certificate, user: pki.Certificate) -> Path:
    """Write a kubeconfig whose one context talks to `server` as the certificate's user."""
    name = "robovast-testbed"
    document = {
        "apiVersion": "v1",
        "kind": "Config",
        "current-context": name,
        "clusters": [
            {"name": name, "cluster": {"server": server, "certificate-authority": str(root.file)}}
        ],
        "users": [
            {
                "name": name,
                "user": {
                    "client-certificate": str(user.file),
                    "client-key": str(user.key),
                },
            }
        ],
        "contexts": [{"name": name, "context": {"cluster": name, "user": name}}],
    }
    path.write_text(json.dumps(document, indent=1))
    path.chmod(0o600)
    return path
