"""The API server, as the user's kubeconfig leads to it."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Coroutine, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from robovast.base.errors import CannotRunError, RobovastError
from robovast.kubeapi.resources import API_VERSION
from robovast_cli.kube.api_errors import NotFoundError, NotInstalledError, refusal, unreachable
from robovast_cli.kube.kubeconfig import choose
from robovast_cli.kube.port_forward import PortForward

if TYPE_CHECKING:
    from anyio.from_thread import BlockingPortal

PATIENCE = 20.0
"""How long an API server may take to answer [s]."""

Json = dict[str, Any]

BATCH = "batch/v1"

KUEUE = "kueue.x-k8s.io"
"""API group of Kueue, which admits Jobs when there is room for them."""


class Kubernetes:
    """One API server, namespace and user.

    Methods raise `RobovastError` when the server refuses or cannot be reached.
    """

    def __init__(self, api: Any, portal: BlockingPortal) -> None:
        self._api = api
        self._portal = portal
        self.context = str(api.auth.active_context)
        """Name of the kubeconfig's context; empty inside a pod."""
        self.namespace = str(api.auth.namespace)

    @property
    def where(self) -> str:
        """The API server, as messages name it."""
        return _where(self.context, str(self._api.auth.server))

    def campaigns(self) -> list[Json]:
        """All Campaigns of the namespace, the oldest first."""
        return self._list("campaigns", API_VERSION, {})

    def campaign(self, name: str) -> Json | None:
        """A Campaign; None when there is none of this name."""
        return self._find("campaigns", name, API_VERSION)

    def create_campaign(self, campaign: Json) -> Json:
        """Create a Campaign."""
        return self._call("POST", "campaigns", API_VERSION, body=campaign)

    def patch_campaign(self, name: str, spec: Mapping[str, Any]) -> Json:
        """Change keys of a Campaign's spec."""
        url = f"campaigns/{quote(name)}"
        return self._call("PATCH", url, API_VERSION, body={"spec": spec})

    def delete_campaign(self, name: str) -> None:
        """Delete a Campaign; what was made for it disappears after it."""
        options = {"propagationPolicy": "Background"}
        self._call("DELETE", f"campaigns/{quote(name)}", API_VERSION, body=options)

    def version_of(self, group: str) -> str | None:
        """API version of a group's resources, as `kueue.x-k8s.io/v1beta1`; None without them."""
        try:
            found = self._call("GET", group, "", namespace="")
        except NotInstalledError:
            return None
        return str(found["preferredVersion"]["groupVersion"])

    def has_queue(self, name: str) -> bool:
        """True when the namespace has a Kueue LocalQueue, and the user may see it."""
        version = self.version_of(KUEUE)
        try:
            return bool(version and self._find("localqueues", name, version))
        except CannotRunError:
            return False

    def secret(self, name: str) -> Json | None:
        """A Secret; None when there is none of this name."""
        return self._find("secrets", name)

    def service(self, name: str, namespace: str) -> Json | None:
        """A Service; None when there is none of this name."""
        return self._find("services", name, namespace=namespace)

    def has_pods(self, labels: Mapping[str, str]) -> bool:
        """True when the namespace has pods with all these labels, or Jobs that make some."""
        return bool(self.jobs(labels) or self.pods(labels))

    def pods(self, labels: Mapping[str, str]) -> list[Json]:
        """The namespace's pods with all these labels, the oldest first."""
        return self._list("pods", "v1", labels)

    def log_end(self, pod: str, lines: int) -> str:
        """The last lines of the log of a pod with one container."""
        url, params = f"pods/{quote(pod)}/log", {"tailLines": str(lines)}
        text: str = self._run(partial(self._text, "GET", url, params=params))
        return text

    def jobs(self, labels: Mapping[str, str]) -> list[Json]:
        """The namespace's Jobs with all these labels, the oldest first."""
        return self._list("jobs", BATCH, labels)

    def job(self, name: str) -> Json | None:
        """A Job; None when there is none of this name."""
        return self._find("jobs", name, BATCH)

    def create_job(self, job: Json) -> Json:
        """Create a Job."""
        return self._call("POST", "jobs", BATCH, body=job)

    def start_job(self, name: str) -> Json:
        """Let a Job that was created suspended begin."""
        body = {"spec": {"suspend": False}}
        return self._call("PATCH", f"jobs/{quote(name)}", BATCH, body=body)

    def delete_job(self, name: str) -> None:
        """Delete a Job; its pods, and what it owns, disappear after it."""
        options = {"propagationPolicy": "Background"}
        with suppress(NotFoundError):
            self._call("DELETE", f"jobs/{quote(name)}", BATCH, body=options)

    def create_secret(self, secret: Json) -> None:
        """Create a Secret."""
        self._call("POST", "secrets", body=secret)

    @contextmanager
    def forward(self, service: Json, target: int | str) -> Iterator[int]:
        """Forward a port of this machine to the pods of a Service, while the context lasts.

        Args:
            service: the Service.
            target: port of its pods, by number or by name.

        Yields:
            The port on this machine's loopback.
        """
        labels = service["spec"].get("selector") or {}
        namespace = service["metadata"]["namespace"]

        async def pods() -> list[Json]:
            answer = await self._request("GET", "pods", namespace=namespace, params=_with(labels))
            items: list[Json] = answer["items"]
            return items

        forward = PortForward(self._api, pods, target)
        port = self._run(forward.start)
        try:
            yield port
        finally:
            self._run(forward.stop)

    def _list(self, kind: str, version: str, labels: Mapping[str, str]) -> list[Json]:
        params = _with(labels) if labels else None
        found: list[Json] = self._call("GET", kind, version, params=params)["items"]
        return sorted(found, key=lambda item: str(item["metadata"].get("creationTimestamp")))

    def _find(
        self, kind: str, name: str, version: str = "v1", namespace: str | None = None
    ) -> Json | None:
        try:
            return self._call("GET", f"{kind}/{quote(name)}", version, namespace=namespace)
        except NotFoundError:
            return None

    def _call(self, method: str, url: str, version: str = "v1", **details: Any) -> Json:
        answer: Json = self._run(partial(self._request, method, url, version, **details))
        return answer

    async def _request(self, method: str, url: str, version: str = "v1", **details: Any) -> Json:
        answer: Json = json.loads(await self._text(method, url, version, **details))
        return answer

    async def _text(
        self,
        method: str,
        url: str,
        version: str = "v1",
        *,
        namespace: str | None = None,
        body: Any = None,
        params: Mapping[str, str] | None = None,
    ) -> str:
        kind = "merge-patch+json" if method == "PATCH" else "json"
        async with self._api.call_api(
            method,
            version=version,
            base="" if version else "/apis",
            namespace=self.namespace if namespace is None else namespace,
            url=url,
            content=None if body is None else json.dumps(body),
            headers={"content-type": f"application/{kind}"},
            params=params,
        ) as response:
            text: str = response.text
            return text

    def _run(self, action: Callable[[], Coroutine[Any, Any, Any]]) -> Any:
        try:
            return self._portal.call(action)
        except RobovastError:
            raise
        except Exception as error:
            raise _explained(error, self.where) from error


@contextmanager
def connect(context: str | None = None, namespace: str | None = None) -> Iterator[Kubernetes]:
    """Talk to an API server, which `$KUBECONFIG` and the context choose, as for kubectl.

    Args:
        context: name of the context; the current one when None.
        namespace: the context's when None.

    Raises:
        CannotRunError: there is no such context, or nobody can log in to it.
        InputError: the kubeconfig cannot be read.
    """
    with cluster_extra():
        from anyio.from_thread import start_blocking_portal
        from kr8s.asyncio import Api
    context, namespace = choose(context, namespace)
    with _no_keys_left_behind(), start_blocking_portal() as portal:

        async def log_in() -> Api:
            # kr8s's own factory also asks for the server's version, and warns of younger ones.
            made = Api(bypass_factory=True, context=context, namespace=namespace)
            await made.auth
            made.timeout = PATIENCE
            return made

        try:
            api = portal.call(log_in)
        except Exception as error:
            raise CannotRunError(
                f"{_where(context, '')}: no login: {error or type(error).__name__}. `kubectl "
                "config get-contexts` shows the contexts of your kubeconfig ($KUBECONFIG, else "
                "~/.kube/config)."
            ) from error
        try:
            yield Kubernetes(api, portal)
        finally:
            portal.call(_close, api)


async def _close(api: Any) -> None:
    if api._session is not None:  # kr8s itself never closes it
        await api._session.aclose()


@contextmanager
def cluster_extra() -> Iterator[None]:
    """Imports that need the extra `cluster`."""
    try:
        yield
    except ImportError as error:
        raise CannotRunError(
            f"the package {error.name} is missing: install `robovast[cluster]`."
        ) from None


@contextmanager
def _no_keys_left_behind() -> Iterator[None]:
    """Temporary files go at the end: kr8s writes keys of a kubeconfig into some."""
    before = tempfile.tempdir
    with tempfile.TemporaryDirectory(prefix="robovast-") as folder:
        tempfile.tempdir = folder
        try:
            yield
        finally:
            tempfile.tempdir = before


def _with(labels: Mapping[str, str]) -> dict[str, str]:
    return {"labelSelector": ",".join(f"{key}={value}" for key, value in labels.items())}


def _where(context: str | None, server: str) -> str:
    named = f"the API server of the context `{context}`" if context else "the API server"
    return f"{named} ({server})" if server else named


def _explained(error: Exception, where: str) -> RobovastError:
    import httpx
    import kr8s

    if isinstance(error, kr8s.ServerError) and error.response is not None:
        return refusal(error.response.status_code, _status(error.response), where)
    if isinstance(error, httpx.TransportError | kr8s.APITimeoutError | OSError):
        return unreachable(str(error) or type(error).__name__, where)
    return CannotRunError(f"{where}: {type(error).__name__}: {error}")


def _status(response: Any) -> Json:
    try:
        answer = response.json()
    except ValueError:
        return {}
    return answer if isinstance(answer, dict) else {}
