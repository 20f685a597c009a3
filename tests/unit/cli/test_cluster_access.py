"""How the cluster's API and storage are reached, and what is said when they are not."""

from __future__ import annotations

import json
import os
import socket
import threading
from pathlib import Path
from typing import Any

import pytest

from robovast.base.errors import CannotRunError, InputError
from robovast_cli.kube.api import connect
from robovast_cli.kube.api_errors import (
    ConflictError,
    NotFoundError,
    NotInstalledError,
    UnreachableError,
    refusal,
)
from robovast_cli.kube.kubeconfig import select_context
from robovast_cli.kube.port_forward import select_pod
from robovast_cli.kube.store import cluster_service

WHERE = "the API server"


@pytest.mark.parametrize(
    ("endpoint", "service"),
    [
        ("http://robovast-s3.robovast.svc:9000", ("robovast-s3", "robovast", 9000)),
        ("http://s3.ns.svc.cluster.local", ("s3", "ns", 80)),
        ("https://s3.ns.svc", ("s3", "ns", 443)),
        ("https://s3.example.org", None),
        ("http://10.0.0.1:9000", None),
        ("", None),
    ],
)
def test_services_of_the_cluster_are_told_from_other_servers(
    endpoint: str, service: tuple[str, str, int] | None
) -> None:
    assert cluster_service(endpoint) == service


def pod(name: str, ready: str, **metadata: str) -> dict[str, Any]:
    ports = [{"name": "s3", "containerPort": 9000}]
    return {
        "metadata": {"name": name, **metadata},
        "spec": {"containers": [{}, {"ports": ports}]},
        "status": {"conditions": [{"type": "Ready", "status": ready}]},
    }


def test_connections_go_to_a_pod_that_is_ready_and_stays() -> None:
    going = pod("going", "True", deletionTimestamp="2026-01-01T00:00:00Z")
    pods = [pod("slow", "False"), going, pod("good", "True")]
    for target in ("s3", 9000):
        chosen, port = select_pod(pods, target)
        assert (chosen["metadata"]["name"], port) == ("good", 9000)
    for left, target in ((pods[:2], 9000), (pods, "other")):
        with pytest.raises(CannotRunError, match="ready"):
            select_pod(left, target)


@pytest.mark.parametrize(
    ("code", "status", "kind", "said"),
    [
        (404, {}, NotInstalledError, "vast exec cluster setup"),
        (404, {"details": {"name": "x"}, "message": "no x"}, NotFoundError, "no x"),
        (409, {"message": "x exists"}, ConflictError, "x exists"),
        (401, {"message": "Unauthorized"}, CannotRunError, "Log in again"),
        (
            403,
            {"message": "u may not"},
            CannotRunError,
            "u may not. Ask your cluster administrator",
        ),
        (
            403,
            {"message": "x: exceeded quota: q"},
            CannotRunError,
            "quota: q. Delete unused objects",
        ),
        (413, {"message": "too large"}, InputError, "too large"),
        (503, {}, UnreachableError, "HTTP status 503"),
    ],
)
def test_each_refusal_says_what_to_do(
    code: int, status: dict[str, Any], kind: type[Exception], said: str
) -> None:
    error = refusal(code, status, WHERE)
    assert type(error) is kind
    assert said in str(error)


def test_refused_fields_of_the_document_are_named_as_in_the_file() -> None:
    causes = [
        {"field": "spec.vast.execution.runs", "message": "must be a number"},
        {"field": "spec.parallelism", "message": "too small"},
        {"field": "<nil>", "message": "some rules were not checked"},
    ]
    details = {"kind": "Campaign", "name": "x", "causes": causes}
    error = refusal(422, {"message": "invalid", "details": details}, WHERE)
    assert str(error).splitlines() == [
        "the API server rejected the Campaign `x`:",
        "    execution.runs: must be a number",
        "    spec.parallelism: too small",
        "    some rules were not checked",
    ]


def write_config(path: Path, current: str, **namespaces: str) -> None:
    contexts = [
        {"name": name, "context": {"cluster": "c", "user": "u", "namespace": namespace}}
        for name, namespace in namespaces.items()
    ]
    path.write_text(json.dumps({"contexts": contexts, "current-context": current}))


@pytest.mark.parametrize(
    ("context", "namespace", "chosen"),
    [
        (None, None, ("lab", "tests")),
        ("home", None, ("home", "default")),
        ("home", "mine", ("home", "mine")),
    ],
)
def test_several_kubeconfigs_count_together(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    context: str | None,
    namespace: str | None,
    chosen: tuple[str | None, str | None],
) -> None:
    write_config(tmp_path / "a", "", home="")
    write_config(tmp_path / "b", "lab", lab="tests", home="shadowed")
    paths = [tmp_path / name for name in ("a", "missing", "b")]
    monkeypatch.setenv("KUBECONFIG", os.pathsep.join(map(str, paths)))
    assert select_context(context, namespace) == chosen


def test_a_context_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_config(tmp_path / "a", "", home="")
    monkeypatch.setenv("KUBECONFIG", str(tmp_path / "a"))
    with pytest.raises(
        CannotRunError, match=r"context `other` does not exist in your kubeconfig.* has home\."
    ):
        select_context("other", None)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a: [", "broken:2:1: not valid YAML: a value or a closing bracket is missing"),
        (b"- 1\n", "broken is not a valid kubeconfig: it contains no mapping"),
        (b"\xff", "broken: not a text file in UTF-8"),
    ],
)
def test_a_broken_kubeconfig_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes, message: str
) -> None:
    (tmp_path / "broken").write_bytes(content)
    monkeypatch.setenv("KUBECONFIG", str(tmp_path / "broken"))
    with pytest.raises(InputError, match=message):
        select_context(None, None)


def test_a_server_without_tls_is_told_from_one_that_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def answer_in_plain(server: socket.socket) -> None:
        with server.accept()[0] as connection:
            connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"https://127.0.0.1:{server.getsockname()[1]}"
        cluster = {"name": "c", "cluster": {"server": address}}
        context = {"name": "lab", "context": {"cluster": "c", "user": "u"}}
        user = {"name": "u", "user": {"token": "t"}}
        config = {"clusters": [cluster], "contexts": [context], "users": [user]}
        (tmp_path / "config").write_text(json.dumps({**config, "current-context": "lab"}))
        monkeypatch.setenv("KUBECONFIG", str(tmp_path / "config"))
        thread = threading.Thread(target=answer_in_plain, args=[server])
        thread.start()
        with connect() as kube, pytest.raises(UnreachableError, match="wrong version number"):
            kube.campaigns()
        thread.join(10)
