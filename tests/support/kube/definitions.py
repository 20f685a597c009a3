"""The resource definitions of this chart, and of those that came before it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from robovast_testbed.errors import StartFailed
from robovast_testbed.kubernetes import Cluster

from support.patience import eventually

CRDS = Path(__file__).parents[3] / "crds"
OLDER, NEWER = "v1alpha1", "v1beta1"
VERSIONS = (OLDER, NEWER)

Definition = dict[str, Any]


def await_definitions(cluster: Cluster) -> None:
    """Wait until both kinds are served; `kubectl wait` fails where one has no conditions yet."""

    def served() -> bool:
        kinds = ("campaigns.robovast.io", "configurations.robovast.io")
        found = json.loads(cluster.kubectl("get", "crd", *kinds, "--output=json"))["items"]
        conditions = [(item.get("status") or {}).get("conditions") or () for item in found]
        established = {"type": "Established", "status": "True"}
        return all(any(established.items() <= c.items() for c in of_one) for of_one in conditions)

    eventually(served)


def now() -> list[Definition]:
    """Those of this chart, which serve both versions."""
    return [yaml.safe_load(path.read_text()) for path in sorted(CRDS.glob("*.yaml"))]


def of_chart_0_1_0() -> list[Definition]:
    """Those of the chart that knew the newer version and did not serve it."""
    return [_changed(made, lambda versions: versions[1].update(served=False)) for made in now()]


def of_one_version() -> list[Definition]:
    """Those of the charts before it, which did not know the newer version."""
    return [_changed(made, lambda versions: versions.pop() and None) for made in now()]


def _changed(made: Definition, change: Callable[[list[Any]], None]) -> Definition:
    change(made["spec"]["versions"])
    return made


@dataclass(frozen=True)
class Redefined(Cluster):
    """A cluster whose definitions are exchanged, by a kubectl that nobody else goes by."""

    cache: Path

    def kubectl(self, *arguments: str | Path, stdin: str | None = None) -> str:
        return super().kubectl(f"--cache-dir={self.cache}", *arguments, stdin=stdin)

    def define(self, definitions: list[Definition]) -> None:
        """Exchange the definitions, and wait until the API server goes by them."""
        apply = ("apply", "--server-side", "--force-conflicts", "--filename=-")
        self.kubectl(*apply, stdin=yaml.safe_dump_all(definitions))
        for definition in definitions:
            plural = definition["spec"]["names"]["plural"]
            known = {v["name"]: v["served"] for v in definition["spec"]["versions"]}
            for version in VERSIONS:
                wanted = known.get(version, False)
                eventually(lambda v=version, w=wanted, p=plural: self.serves(v, p) == w)  # type: ignore[misc]
        shutil.rmtree(self.cache, ignore_errors=True)

    def serves(self, version: str, plural: str = "campaigns") -> bool:
        """Whether objects can be read in a version."""
        try:
            self.kubectl("get", f"--raw=/apis/robovast.io/{version}/{plural}?limit=1")
        except StartFailed:
            return False
        return True

    def stored_versions(self) -> list[list[str]]:
        """In which versions objects of each kind may be stored."""
        found: Any = self.get("crd", "campaigns.robovast.io", "configurations.robovast.io")
        return [item["status"]["storedVersions"] for item in found["items"]]


@contextmanager
def redefined(cluster: Cluster, folder: Path) -> Iterator[Redefined]:
    """The cluster, whose definitions are this chart's again in the end."""
    made = Redefined(cluster.bed, folder / "kubectl-cache")
    try:
        yield made
    finally:
        made.define(now())


def as_version(obj: dict[str, Any], version: str) -> dict[str, Any]:
    """The object as a manifest of that version."""
    return {**obj, "apiVersion": f"robovast.io/{version}"}


def read(cluster: Cluster, version: str, namespace: str, name: str) -> dict[str, Any]:
    """The Campaign as a client of one version sees it."""
    path = f"/apis/robovast.io/{version}/namespaces/{namespace}/campaigns/{name}"
    found: dict[str, Any] = json.loads(cluster.kubectl("get", f"--raw={path}"))
    assert found.pop("apiVersion") == f"robovast.io/{version}"
    return found
