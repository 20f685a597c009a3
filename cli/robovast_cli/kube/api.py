"""Requests to the API server of the user's kubeconfig."""

from __future__ import annotations

import binascii
import errno
import json
import os
import shutil
import ssl
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from robovast.base.errors import CannotRunError, RobovastError
from robovast.base.optional_deps import CLUSTER
from robovast.kubeapi.resources import API_VERSION
from robovast_cli.kube.api_errors import NotFoundError, NotInstalledError, refusal, unreachable
from robovast_cli.kube.kubeconfig import cluster_options, files, login_program, select_context
from robovast_cli.kube.port_forward import PortForward

if TYPE_CHECKING:
    from anyio.from_thread import BlockingPortal

TIME_LIMIT = 20.0
"""Timeout of requests to an API server [s]."""

Json = dict[str, Any]

BATCH = "batch/v1"

SERVICE_ACCOUNT = Path("/var/run/secrets/kubernetes.io/serviceaccount")
"""Folder of a pod's credentials."""

KUEUE = "kueue.x-k8s.io"
"""API group of Kueue, which admits Jobs when there is room for them."""


class KubernetesClient:
    """Client of one API server, namespace and user.

    Methods raise `RobovastError` if the server rejects a request or cannot be reached.
    """

    def __init__(
        self,
        client: Any,
        portal: BlockingPortal,
        context: str | None,
        namespace: str,
        options: str = "",
    ) -> None:
        self._client = client
        self._portal = portal
        self.context = context or ""
        """Name of the kubeconfig's context; empty inside a pod."""
        self.namespace = namespace
        self.cluster_options = options
        """Options that select this cluster, for commands in messages: ` --namespace lab`."""

    @property
    def where(self) -> str:
        """Name of the API server in messages."""
        return _where(self.context, str(self._client.configuration.host))

    def campaigns(self) -> list[Json]:
        """Return all Campaigns of the namespace, the oldest first."""
        return self._list("campaigns", API_VERSION, {})

    def campaign(self, name: str) -> Json | None:
        """Return a Campaign by name, or None."""
        return self._find("campaigns", name, API_VERSION)

    def create_campaign(self, campaign: Json) -> Json:
        """Create a Campaign."""
        return self._call("POST", "campaigns", API_VERSION, body=campaign)

    def patch_campaign(self, name: str, spec: Mapping[str, Any]) -> Json:
        """Change keys of a Campaign's spec."""
        url = f"campaigns/{quote(name)}"
        return self._call("PATCH", url, API_VERSION, body={"spec": spec})

    def delete_campaign(self, name: str) -> None:
        """Delete a Campaign; Kubernetes then deletes the objects that it owns."""
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
        """Return whether the namespace has a Kueue LocalQueue that the user may read."""
        version = self.version_of(KUEUE)
        try:
            return bool(version and self._find("localqueues", name, version))
        except CannotRunError:
            return False

    def secret(self, name: str) -> Json | None:
        """Return a Secret by name, or None."""
        return self._find("secrets", name)

    def service(self, name: str, namespace: str) -> Json | None:
        """Return a Service by name, or None."""
        return self._find("services", name, namespace=namespace)

    def has_pods(self, labels: Mapping[str, str]) -> bool:
        """Return whether the namespace has pods or Jobs with all these labels."""
        return bool(self.jobs(labels) or self.pods(labels))

    def pods(self, labels: Mapping[str, str]) -> list[Json]:
        """Return the pods with all these labels, the oldest first."""
        return self._list("pods", "v1", labels)

    def create_pod(self, pod: Json) -> Json:
        """Create a pod."""
        return self._call("POST", "pods", body=pod)

    def config_map(self, name: str) -> Json | None:
        """Return a ConfigMap by name, or None."""
        return self._find("configmaps", name)

    def config_maps(self, labels: Mapping[str, str]) -> list[Json]:
        """Return the ConfigMaps with all these labels, the oldest first."""
        return self._list("configmaps", "v1", labels)

    def log(self, pod: str, container: str, *, follow: bool = False) -> Iterator[str]:
        """Yield the lines of a container's log; with `follow`, also new lines until it ends.

        Raises:
            NotFoundError: there is no such pod, or no such log of it.
        """
        params = {"container": container, "follow": str(follow).lower()}
        url = f"pods/{quote(pod)}/log"
        answer = self._run(partial(self._respond, "GET", url, params=params, seconds=None))
        content = answer.response.content
        try:
            yield from _lines(iter(partial(self._run, content.readany), b""))
        finally:
            self._portal.call(answer.response.close)

    def log_end(self, pod: str, lines: int) -> str:
        """Return the last lines of the log of a pod with one container."""
        url, params = f"pods/{quote(pod)}/log", {"tailLines": str(lines)}
        text: str = self._run(partial(self._text, "GET", url, params=params))
        return text

    def jobs(self, labels: Mapping[str, str]) -> list[Json]:
        """Return the Jobs with all these labels, the oldest first."""
        return self._list("jobs", BATCH, labels)

    def job(self, name: str) -> Json | None:
        """Return a Job by name, or None."""
        return self._find("jobs", name, BATCH)

    def create_job(self, job: Json) -> Json:
        """Create a Job."""
        return self._call("POST", "jobs", BATCH, body=job)

    def start_job(self, name: str) -> Json:
        """Start a Job that was created suspended."""
        body = {"spec": {"suspend": False}}
        return self._call("PATCH", f"jobs/{quote(name)}", BATCH, body=body)

    def delete_job(self, name: str) -> None:
        """Delete a Job; Kubernetes then deletes its pods and the objects that it owns."""
        options = {"propagationPolicy": "Background"}
        with suppress(NotFoundError):
            self._call("DELETE", f"jobs/{quote(name)}", BATCH, body=options)

    def create_secret(self, secret: Json) -> None:
        """Create a Secret."""
        self._call("POST", "secrets", body=secret)

    @contextmanager
    def forward(self, service: Json, target: int | str) -> Iterator[int]:
        """Yield a port of this machine that is forwarded to a port of the pods of a Service.

        Args:
            service: Service resource.
            target: port of its pods, by number or by name.
        """
        labels = service["spec"].get("selector") or {}
        namespace = service["metadata"]["namespace"]

        async def pods() -> list[Json]:
            answer = await self._request("GET", "pods", namespace=namespace, params=_with(labels))
            items: list[Json] = answer["items"]
            return items

        forward = PortForward(self._client.configuration, pods, target)
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

    async def _text(self, *request: Any, **details: Any) -> str:
        answer = await self._respond(*request, **details)
        text: str = (await answer.read()).decode()
        return text

    async def _respond(
        self,
        method: str,
        url: str,
        version: str = "v1",
        *,
        namespace: str | None = None,
        body: Any = None,
        params: Mapping[str, str] | None = None,
        seconds: float | None = TIME_LIMIT,
    ) -> Any:
        """Return the response to a request, whose content may not have arrived."""
        root = f"/{'apis' if '/' in version else 'api'}/{version}" if version else "/apis"
        space = self.namespace if namespace is None else namespace
        kind = "merge-patch+json" if method == "PATCH" else "json"
        ask = partial(
            self._answer,
            seconds,
            method,
            f"{root}/namespaces/{space}/{url}" if space else f"{root}/{url}",
            query_params=dict(params or {}),
            header_params={"Content-Type": f"application/{kind}"},
            body=body,
            auth_settings=["BearerToken"],
        )
        answer = await ask()
        if answer.status == 401:  # credentials can expire while a campaign runs for hours
            _login(self._client.configuration, self.context)
            answer = await ask()
        if answer.status >= 400:
            text = (await answer.read()).decode()
            raise refusal(answer.status, _status(text), self.where)
        return answer

    async def _answer(self, seconds: float | None, *request: Any, **details: Any) -> Any:
        from aiohttp import ClientTimeout

        serialized = await self._client.param_serialize(*request, **details)
        timeout = ClientTimeout(total=seconds, sock_connect=TIME_LIMIT)
        return await self._client.call_api(*serialized, _request_timeout=timeout)

    def _run(self, action: Callable[[], Coroutine[Any, Any, Any]]) -> Any:
        try:
            return self._portal.call(action)
        except RobovastError:
            raise
        except Exception as error:
            raise _as_cli_error(error, self.where) from error


@contextmanager
def connect(context: str | None = None, namespace: str | None = None) -> Iterator[KubernetesClient]:
    """Connect to the API server that `$KUBECONFIG` and the context select, as kubectl does.

    Args:
        context: name of the context (default: the current context).
        namespace: name of the namespace (default: from the context).

    Raises:
        CannotRunError: the context is missing, or its login fails.
        InputError: the kubeconfig cannot be read.
    """
    with CLUSTER.needed_by("Access to a cluster"):
        from anyio.from_thread import start_blocking_portal
        from kubernetes.aio.client import ApiClient, Configuration
    options = cluster_options(context, namespace)
    context, namespace = select_context(context, namespace)
    try:
        server = Configuration()
        _login(server, context)
        client = ApiClient(server)
        namespace = namespace or (SERVICE_ACCOUNT / "namespace").read_text(encoding="utf-8")
    except Exception as error:
        raise CannotRunError(
            f"cannot log in to {_where(context, '')}: {_login_problem(error)}",
            hint=f"{_remedy(error)}run `kubectl config get-contexts` to list the contexts of your "
            "kubeconfig ($KUBECONFIG, else ~/.kube/config)",
        ) from error
    with start_blocking_portal() as portal:
        try:
            yield KubernetesClient(client, portal, context, namespace, options)
        finally:
            portal.call(client.close)


def _login(server: Any, context: str | None) -> None:
    """Set the address and the credentials of an API server: from a context, else of this pod."""
    from kubernetes import config

    if not context:
        try:
            config.load_incluster_config(client_configuration=server)
        except config.ConfigException as error:
            cause = "no kubeconfig has a current context, and this is not a pod"
            raise CannotRunError(cause) from error
        return
    # The loader of kubernetes.aio neither renews tokens nor stores renewed tokens.
    program = login_program(context)
    if program and os.sep not in program and shutil.which(program) is None:
        raise CannotRunError(
            f"the login program `{program}` of the kubeconfig is not installed",
            hint=f"install `{program}`, or use another context with `--context`",
        )
    config.load_kube_config(files(), context, client_configuration=server)
    if program and not (server.api_key or server.cert_file):
        raise CannotRunError(
            f"the login program `{program}` of the kubeconfig returned no credentials",
            hint="log in again, or use another context with `--context`",
        )
    if server.proxy:
        server.client_session_kwargs = {"proxy": server.proxy}  # also used by port forwarding


def _lines(chunks: Iterable[bytes]) -> Iterator[str]:
    rest = b""
    for chunk in chunks:
        *lines, rest = (rest + chunk).split(b"\n")
        yield from (line.decode(errors="replace") for line in lines)
    if rest:
        yield rest.decode(errors="replace")


def _with(labels: Mapping[str, str]) -> dict[str, str]:
    return {"labelSelector": ",".join(f"{key}={value}" for key, value in labels.items())}


def _login_problem(error: Exception) -> str:
    if isinstance(error, binascii.Error):
        return "a certificate, key or token in the kubeconfig is not valid base64"
    if isinstance(error, OSError):
        return f"{error.filename} cannot be read: {error.strerror}"
    said = error.message if isinstance(error, RobovastError) else str(error)
    return said.rstrip(".") or type(error).__name__


def _remedy(error: Exception) -> str:
    hint = error.hint if isinstance(error, RobovastError) else ""
    return f"{hint}, or " if hint else ""


def _where(context: str | None, server: str) -> str:
    named = f"the API server of the context `{context}`" if context else "the API server"
    return f"{named} ({server})" if server else named


def _as_cli_error(error: Exception, where: str) -> RobovastError:
    from aiohttp import ClientError

    if isinstance(error, ClientError | OSError):
        cause = getattr(error, "os_error", error)  # the message of aiohttp contains its objects
        own = isinstance(cause, ssl.SSLError)  # numbers of TLS errors are not errno
        number = cause.errno or 0 if isinstance(cause, OSError) and not own else 0
        text = os.strerror(number) if number in errno.errorcode else str(cause)
        return unreachable(text or type(error).__name__, where)
    return CannotRunError(f"{where}: {type(error).__name__}: {error}")


def _status(text: str) -> Json:
    try:
        answer = json.loads(text)
    except ValueError:
        return {}
    return answer if isinstance(answer, dict) else {}
