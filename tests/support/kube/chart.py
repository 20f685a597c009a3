"""The chart's objects, without installing it."""

from __future__ import annotations

import json
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from robovast_testbed import gobuild, programs
from robovast_testbed.kubernetes import Cluster

from robovast.base.yaml_files import YamlLoader

CHART = Path(__file__).parents[3] / "helm/robovast"
Object = dict[str, Any]


def template(values: Object, cluster: Cluster | None = None, namespace: str = "system") -> str:
    """What `helm template` prints; with a cluster, the chart may look at that.

    Raises:
        ValueError: Helm refuses; the message is Helm's.
    """
    seen = ("--dry-run=server", f"--kubeconfig={cluster.kubeconfig}") if cluster else ()
    print_now = _print if cluster is None else _print.__wrapped__
    return print_now(json.dumps(values), namespace, *seen)


@cache
def _print(values: str, namespace: str, *options: str) -> str:
    done = subprocess.run(
        [
            *(gobuild.build(programs.HELM), "template", "robovast", CHART, "--values=-"),
            *(f"--namespace={namespace}", "--kube-version=1.36.0", *options),
        ],
        input=values, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise ValueError(done.stderr)
    return done.stdout


def rendered(
    values: Object | None = None, cluster: Cluster | None = None, namespace: str = "system"
) -> list[Object]:
    """The objects that Helm would create."""
    text = template(values or {}, cluster, namespace)
    return [obj for obj in yaml.load_all(text, Loader=YamlLoader) if obj]  # the safe one


def of_kind(objects: list[Object], kind: str) -> dict[str, Object]:
    """Objects of a kind, by name, with the namespace before it where they state one."""
    found = {}
    for obj in objects:
        meta = obj["metadata"]
        if obj["kind"] == kind:
            found["/".join(filter(None, (meta.get("namespace"), meta["name"])))] = obj
    return found
