"""A cluster whose Jobs Kueue executes in another one: each has one real node."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

from robovast_testbed import bed, images, network, node, s3
from robovast_testbed.kubernetes import Cluster, Manifest

from support.kube.lab import Lab, install
from support.kube.worker_clusters import (
    Worker,
    access,
    documented,
    local_queue,
    queue,
    with_kueue,
)

WORKER, HERE = "workers", "here"
"""Queues that lead to the worker `south`, and to the manager's own node."""
S3_MAKE = "minio"


@dataclass(frozen=True)
class Pair:
    """A manager with RoboVAST, the worker `south` without, and an S3 server beside the worker."""

    manager: Cluster
    worker: Worker
    storage: s3.Server


@dataclass(frozen=True)
class Labs:
    """A namespace of the same name in both clusters, as the admin's page demands."""

    manager: Lab
    worker: Lab


@contextmanager
def pair(on_manager: Sequence[Path] = ()) -> Iterator[Pair]:
    """Start all; without further images the manager's node could not even execute a run.

    Args:
        on_manager: archives of such images.
    """
    with ExitStack() as stack, ThreadPoolExecutor() as pool:
        near, far = (
            stack.enter_context(bed.session(f"pytest-{os.getpid()}-{name}"))
            for name in ("manager", "south")
        )
        cable = network.connect(near, far, 0)
        cable.carry_pods()
        managers = pool.submit(_manager, near, _storage(cable), on_manager)
        south = _with_node(far, [images.agent_archive(), images.archive()])
        made = Pair(managers.result(), Worker(south, cable), s3.start(far, S3_MAKE))
        south.apply(*queue("own"))
        made.manager.apply(*documented(), access("south", made.worker))
        made.manager.apply(*queue(WORKER, WORKER), *queue(HERE))
        yield made


def _manager(own: bed.Bed, storage: Mapping[str, str], archives: Sequence[Path]) -> Cluster:
    cluster = _with_node(own, archives)
    install(cluster, storage)
    return cluster


def _with_node(own: bed.Bed, archives: Sequence[Path]) -> Cluster:
    cluster = with_kueue(own)
    node.start(cluster, archives)
    return cluster


def _storage(cable: network.Cable) -> dict[str, str]:
    """The chart's values for the S3 server, which has one address for all pods."""
    return {
        "storage.embedded.enabled": "false",
        "storage.external.endpoint": f"http://{cable.address}:{s3.MAKES[S3_MAKE].port}",
        "storage.credentials.existingSecret": "robovast-storage",
    }


def make_labs(made: Pair, folder: Path) -> Labs:
    """A new namespace in both clusters, with its queues and credentials."""
    name = f"lab-{uuid4().hex[:6]}"
    queues = {made.manager: {WORKER: WORKER, HERE: HERE}, made.worker.cluster: {WORKER: "own"}}
    for cluster, leads in queues.items():
        cluster.kubectl("create", "namespace", name)
        cluster.apply(_credentials(name, made.storage))
        cluster.apply(*(local_queue(q, name, to) for q, to in leads.items()))
    outside = {"ROBOVAST_S3_ENDPOINT": f"http://{made.storage.endpoint}"}
    labs = (Lab(c, name, folder, {**c.env, **outside}) for c in queues)
    return Labs(*labs)


def _credentials(namespace: str, storage: s3.Server) -> Manifest:
    return {
        "apiVersion": "v1",
        "kind": "Secret",
        "metadata": {"name": "robovast-storage", "namespace": namespace},
        "stringData": {"accessKey": storage.access_key, "secretKey": storage.secret_key},
    }
