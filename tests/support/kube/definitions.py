"""The resource definitions of this chart."""

from __future__ import annotations

import json
from pathlib import Path

from robovast_testbed.kubernetes import Cluster

from support.patience import eventually

CRDS = Path(__file__).parents[3] / "crds"


def await_definitions(cluster: Cluster) -> None:
    """Wait until both kinds are served; `kubectl wait` fails where one has no conditions yet."""

    def served() -> bool:
        kinds = ("campaigns.robovast.io", "configurations.robovast.io")
        found = json.loads(cluster.kubectl("get", "crd", *kinds, "--output=json"))["items"]
        conditions = [(item.get("status") or {}).get("conditions") or () for item in found]
        established = {"type": "Established", "status": "True"}
        return all(any(established.items() <= c.items() for c in of_one) for of_one in conditions)

    eventually(served)
