"""Connect from this machine to the S3 server of a cluster, or of the environment."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from robovast.base.backoff import REPEATABLE
from robovast.base.errors import CannotRunError, StorageError
from robovast.base.optional_deps import CLUSTER
from robovast.kubeapi.names import CREDENTIALS_SECRET
from robovast_cli.kube.api import Json, KubernetesClient
from robovast_cli.kube.status import CampaignState

if TYPE_CHECKING:
    from robovast.storage.s3 import ObjectStore


ENDPOINT = "ROBOVAST_S3_ENDPOINT"
ACCESS_KEY = "ROBOVAST_S3_ACCESS_KEY"
SECRET_KEY = "ROBOVAST_S3_SECRET_KEY"  # noqa: S105 - the name of a variable

CONNECTIONS = 16


@dataclass(frozen=True)
class StorePlace:
    """An S3 server, and the Secret with the keys of an account."""

    endpoint: str
    """URL for pods."""
    region: str | None = None
    secret: str = CREDENTIALS_SECRET


def store_from_environment() -> ObjectStore | None:
    """Return the store whose address and keys are in the environment, or None."""
    address, *keys = (os.environ.get(name, "") for name in (ENDPOINT, ACCESS_KEY, SECRET_KEY))
    if not address or not all(keys):
        return None
    with CLUSTER.needed_by("Access to a cluster"):
        from robovast.storage.endpoint import Credentials, Endpoint
        from robovast.storage.s3 import ObjectStore

    credentials = Credentials(*keys)
    return ObjectStore(
        Endpoint.parse(address), credentials, patience=REPEATABLE, connections=CONNECTIONS
    )


def place_of(campaign: CampaignState) -> StorePlace:
    """Return the location of a campaign's results."""
    storage = campaign.storage
    endpoint = campaign.status.endpoint or storage.endpoint or ""
    return StorePlace(endpoint, storage.region, storage.secret_name)


def installed_place(kube: KubernetesClient, known: Sequence[CampaignState]) -> StorePlace:
    """Return the default store, from the Secret, else of a campaign; the endpoint may be empty."""
    noted = _read_place(kube, CREDENTIALS_SECRET)
    endpoints = (campaign.status.endpoint for campaign in reversed(known))
    endpoint = os.environ.get(ENDPOINT) or noted.endpoint or next(filter(None, endpoints), "")
    return StorePlace(endpoint, noted.region)


def _read_place(kube: KubernetesClient, secret: str) -> StorePlace:
    """Return the store that a Secret describes; without an endpoint if it cannot be read."""
    try:
        data = (kube.secret(secret) or {}).get("data") or {}
    except CannotRunError:
        data = {}
    endpoint, region = (
        _decoded(data[key]) if key in data else "" for key in ("endpoint", "region")
    )
    return StorePlace(endpoint, region or None, secret)


@contextmanager
def open_store(kube: KubernetesClient, place: StorePlace) -> Iterator[ObjectStore]:
    """Yield a client of a store.

    `$ROBOVAST_S3_ENDPOINT` replaces an address that only pods can reach. Without it, a Service of
    the cluster is reached by port forwarding. Keys come from `$ROBOVAST_S3_ACCESS_KEY` and
    `$ROBOVAST_S3_SECRET_KEY`, else from the Secret.

    Raises:
        CannotRunError: there are no keys, or no pod serves the Service.
        StorageError: the endpoint is unknown.
    """
    with CLUSTER.needed_by("Access to a cluster"):
        from robovast.storage.endpoint import Credentials, Endpoint
        from robovast.storage.s3 import ObjectStore
    credentials = Credentials(*_keys(kube, place.secret))
    if not place.endpoint:  # the status of the Campaign is missing
        place = _read_place(kube, place.secret)
    with reachable(kube, os.environ.get(ENDPOINT) or place.endpoint) as address:
        endpoint = Endpoint.parse(address, place.region)
        yield ObjectStore(endpoint, credentials, patience=REPEATABLE, connections=CONNECTIONS)


def cluster_service(endpoint: str) -> tuple[str, str, int] | None:
    """Return name, namespace and port if an endpoint is a Service of the cluster, else None."""
    parts = urlsplit(endpoint)
    labels = (parts.hostname or "").split(".")
    if len(labels) < 3 or labels[2] != "svc":
        return None
    return labels[0], labels[1], parts.port or (443 if parts.scheme == "https" else 80)


def _keys(kube: KubernetesClient, secret: str) -> tuple[str, str]:
    given = os.environ.get(ACCESS_KEY), os.environ.get(SECRET_KEY)
    if given[0] and given[1]:
        return given[0], given[1]
    remedy = (
        f"set {ACCESS_KEY} and {SECRET_KEY}, or ask your cluster administrator for the permission "
        "to read that Secret, or for access to the web UI of the cluster (chart: `page.viewers`)"
    )
    try:
        found = kube.secret(secret)
    except CannotRunError as error:
        raise CannotRunError(error.message, hint=remedy) from error
    data = (found or {}).get("data") or {}
    try:
        access, hidden = (_decoded(data[key]) for key in ("accessKey", "secretKey"))
    except KeyError:
        raise CannotRunError(
            f"cannot access the S3 server: the namespace {kube.namespace} has no Secret "
            f"`{secret}` with the keys `accessKey` and `secretKey`",
            hint=remedy,
        ) from None
    return access, hidden


def _decoded(value: str) -> str:
    return base64.b64decode(value).decode().strip()


@contextmanager
def reachable(kube: KubernetesClient, endpoint: str) -> Iterator[str]:
    """Yield the address of an endpoint for this machine; the port of a Service is forwarded.

    Raises:
        StorageError: the endpoint is empty.
        CannotRunError: there is no such Service, or none of its pods is ready.
    """
    if not endpoint:
        raise StorageError(
            "the address of the cluster's S3 server is unknown",
            hint=f"set {ENDPOINT}, for example `https://s3.example.org`",
        )
    service = cluster_service(endpoint)
    if service is None:
        yield endpoint
        return
    name, namespace, port = service
    found = kube.service(name, namespace)
    if found is None:
        raise CannotRunError(
            f"the Service `{name}` does not exist in the namespace {namespace}",
            hint="run `vast exec cluster setup` to install RoboVAST's embedded storage",
        )
    targets = {item["port"]: item.get("targetPort") for item in found["spec"]["ports"]}
    with _forward(kube, found, targets.get(port) or port) as local:
        yield f"{urlsplit(endpoint).scheme}://127.0.0.1:{local}"


@contextmanager
def _forward(kube: KubernetesClient, service: Json, target: int | str) -> Iterator[int]:
    with ExitStack() as stack:
        try:
            port = stack.enter_context(kube.forward(service, target))
        except CannotRunError as error:
            name, namespace = (service["metadata"][key] for key in ("name", "namespace"))
            raise CannotRunError(
                f"cannot connect to the S3 server through the Service `{name}` in the namespace "
                f"{namespace}: {error}",
                hint=f"check `kubectl --namespace {namespace} get pods`",
            ) from error
        yield port
