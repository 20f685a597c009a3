"""The cluster's own storage reached from outside through the API server while pods come and go."""

from __future__ import annotations

import hashlib
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from robovast_testbed import images
from robovast_testbed.kubernetes import Cluster
from support.patience import PATIENCE

from robovast.base.errors import CannotRunError
from robovast_cli.kube.api import connect
from robovast_cli.kube.store import reachable

SERVE = "cd /tmp && seq 3000000 > big && exec python3 -m http.server 9000"
ENDPOINT = "http://storage.port-forward.svc:80"


def pod() -> dict[str, Any]:
    container = {
        "name": "web",
        "image": images.SLIM,
        "imagePullPolicy": "Never",
        "command": ["bash", "-c", SERVE],
        "ports": [{"name": "s3", "containerPort": 9000}],
        "readinessProbe": {"tcpSocket": {"port": 9000}, "periodSeconds": 1},
    }
    return {
        "apiVersion": "v1",
        "kind": "Pod",
        "metadata": {"name": "storage", "namespace": "port-forward", "labels": {"app": "storage"}},
        "spec": {"containers": [container], "terminationGracePeriodSeconds": 0},
    }


SERVICE = {
    "apiVersion": "v1",
    "kind": "Service",
    "metadata": {"name": "storage", "namespace": "port-forward"},
    "spec": {"selector": {"app": "storage"}, "ports": [{"port": 80, "targetPort": "s3"}]},
}


def start(cluster: Cluster) -> None:
    cluster.apply(pod())
    cluster.kubectl(
        *("wait", "--for=condition=Ready", "pod/storage", "--namespace=port-forward"),
        "--timeout=180s",
    )


def test_a_service_is_reached_by_several_connections_and_after_its_pod_was_replaced(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KUBECONFIG", str(cluster.kubeconfig))
    cluster.kubectl("create", "namespace", "port-forward")
    cluster.apply(SERVICE)
    expected = "".join(f"{number}\n" for number in range(1, 3_000_001)).encode()
    with connect() as kube:
        with (
            pytest.raises(CannotRunError, match="none of its pods is ready"),
            reachable(kube, ENDPOINT),
        ):
            pass
        start(cluster)
        with reachable(kube, ENDPOINT) as address:

            def fetch(_: int = 0) -> str:
                with urllib.request.urlopen(f"{address}/big", timeout=PATIENCE) as answer:  # noqa: S310
                    return hashlib.sha256(answer.read()).hexdigest()

            with ThreadPoolExecutor(4) as pool:
                assert set(pool.map(fetch, range(6))) == {hashlib.sha256(expected).hexdigest()}
            cluster.kubectl("delete", "pod", "storage", "--namespace=port-forward", "--now")
            with pytest.raises((ConnectionError, urllib.error.URLError)):
                fetch()
            start(cluster)
            assert fetch() == hashlib.sha256(expected).hexdigest()
    cluster.kubectl("delete", "namespace", "port-forward", "--wait=false")
