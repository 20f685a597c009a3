"""Requests to a test cluster's API server as a user of one's own, without a process for each."""

from __future__ import annotations

import http.client
import json
import ssl
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

from robovast_testbed import controlplane
from robovast_testbed.kubernetes import Cluster

IDLE_SECONDS = 20
"""A connection that was not used for so long may have been ended by the server."""

METADATA = "application/json;as=PartialObjectMetadata;g=meta.k8s.io;v=v1"
"""What to accept when only an object's metadata is asked for."""


class Requests:
    """One connection of one user, who may do everything."""

    def __init__(self, cluster: Cluster, user: str) -> None:
        authority = controlplane.authority_of(cluster)
        certificate = authority.issue(user, user, group="system:masters")
        self._tls = ssl.create_default_context(cafile=str(authority.root.file))
        self._tls.load_cert_chain(certificate.file, certificate.key)
        config = json.loads(cluster.kubeconfig.read_text())
        self._server = urlsplit(config["clusters"][0]["cluster"]["server"]).netloc
        self._connection = self._connect()
        self._used = time.monotonic()

    def close(self) -> None:
        """End the connection."""
        self._connection.close()

    def get(self, path: str, accept: str = "application/json") -> Any:
        """What a path answers."""
        return self._ask("GET", path, None, accept)

    def post(self, path: str, body: dict[str, Any]) -> Any:
        """Create an object."""
        return self._ask("POST", path, body)

    def watch(self, path: str) -> Iterator[Any]:
        """The events of a watch, over a connection of its own, begun again when it ends."""
        while True:
            connection = self._connect()
            connection.request("GET", path)
            for line in connection.getresponse():
                yield json.loads(line)

    def _connect(self) -> http.client.HTTPSConnection:
        return http.client.HTTPSConnection(self._server, context=self._tls)

    def _ask(
        self, verb: str, path: str, body: dict[str, Any] | None, accept: str = "application/json"
    ) -> Any:
        if time.monotonic() - self._used > IDLE_SECONDS:
            self._connection.close()  # the next request opens it again
        content = json.dumps(body) if body is not None else None
        headers = {"Accept": accept, "Content-Type": "application/json"}
        self._connection.request(verb, path, content, headers)
        answer = self._connection.getresponse()
        text = answer.read()
        self._used = time.monotonic()
        if answer.status >= 300:
            raise RuntimeError(f"{verb} {path}: {answer.status} {text[:500].decode()}")
        return json.loads(text)
