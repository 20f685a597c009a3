"""The pod in which somebody looks into a run: the pod of its campaign's Job, that stores nothing.

Pure functions.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from robovast.kubeapi.names import child_name
from robovast.kubeapi.pod_contract.mounts import Object
from robovast.kubeapi.pod_contract.pack_request import AGENT, FETCH, RUN, PackRequest
from robovast.kubeapi.pod_contract.pods import PROGRAM
from robovast.kubeapi.resources import API_VERSION, CAMPAIGN_LABEL, ROLE_LABEL, UID_LABEL

ROLE = "debug"
"""Role of such pods: the operator has nothing to do with them."""
HOURS = 8
"""When one ends by itself, if nobody ends it."""
KEEP_PROCESSES = {"name": "ROBOVAST_KEEP_PROCESSES", "value": "1"}
"""Tells start.sh not to kill the shells of people in the pod when the run ends."""


def debug_pod(campaign: Mapping[str, Any], job: Mapping[str, Any], run: int) -> Object:
    """The pod of a run.

    Args:
        campaign: the Campaign.
        job: its newest Job of runs, whose plan has the run.
        run: id of the run.
    """
    name, uid = campaign["metadata"]["name"], campaign["metadata"]["uid"]
    spec: Object = deepcopy(job["spec"]["template"]["spec"])
    asked = PackRequest(0, run=run).arguments
    containers = [*spec["initContainers"], *spec["containers"]]
    by_fetch = any(container["name"] == FETCH for container in containers)
    for container in containers:
        if container["name"] == FETCH:
            container["command"] = [*PROGRAM, FETCH, *asked]
        elif container["name"] == AGENT:
            container["command"] = [*PROGRAM, "hold", *([] if by_fetch else asked)]
            container.pop("readinessProbe", None)
        elif container["name"] == RUN:
            container["env"] = [*container.get("env", ()), KEEP_PROCESSES]
    spec.pop("topologySpreadConstraints", None)  # it is about the pods of a campaign's runs
    spec["activeDeadlineSeconds"] = HOURS * 3600
    owner = {"apiVersion": API_VERSION, "kind": "Campaign", "name": name, "uid": uid}
    return {
        "apiVersion": "v1",
        "kind": "Pod",
        "metadata": {
            "generateName": f"{child_name(name, uid, 'debug')}-",
            "labels": {CAMPAIGN_LABEL: name, UID_LABEL: uid, ROLE_LABEL: ROLE},
            "ownerReferences": [owner],
        },
        "spec": spec,
    }
