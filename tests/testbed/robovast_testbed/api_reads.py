"""Reads objects from the API server directly: `kubectl` costs 0.2 s of CPU for each call."""

import json
import ssl
from collections.abc import Sequence
from http.client import HTTPException, HTTPSConnection
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode, urlsplit

PLACES = {
    **dict.fromkeys(("campaigns", "configurations"), "apis/robovast.io/v1beta1"),
    **dict.fromkeys(("pods", "events", "secrets", "configmaps", "nodes", "services"), "api/v1"),
    "jobs": "apis/batch/v1",
    "leases": "apis/coordination.k8s.io/v1",
    "deployments": "apis/apps/v1",
}
"""Where the objects of a kind are."""
QUERIES = {
    "--selector": "labelSelector",
    "-l": "labelSelector",
    "--field-selector": "fieldSelector",
}


def read(kubeconfig: Path, arguments: Sequence[str]) -> dict[str, Any] | None:
    """Return what `kubectl get ARGUMENTS --output=json` shows; None if `kubectl` must answer.

    That is for other arguments and kinds, and for all errors.

    Args:
        kubeconfig: of the testbed.
        arguments: a kind, perhaps a name, and options as `--namespace=NAME`.
    """
    words = [word for word in arguments if not word.startswith("-")]
    options = dict(word.partition("=")[::2] for word in arguments if word.startswith("-"))
    kind = words[0] if words and words[0].endswith("s") else f"{''.join(words[:1])}s"
    space = options.pop("--namespace", "default")
    everywhere = options.pop("--all-namespaces", None) is not None or kind == "nodes"
    if (
        kind not in PLACES
        or len(words) > 2
        or not space
        or not options.keys() <= QUERIES.keys()
        or not all(options.values())
    ):
        return None
    server = _Server(json.loads(kubeconfig.read_text()))
    path = "/".join(
        ["", PLACES[kind], *([] if everywhere else ["namespaces", quote(space)]), kind, *words[1:]]
    )
    query = urlencode({QUERIES[name]: value for name, value in options.items()})
    found = server.ask(f"{path}?{query}")
    if found is not None:
        shown = {"apiVersion": found["apiVersion"], "kind": found["kind"].removesuffix("List")}
        for item in found.get("items", [found]):
            item.update(shown)
            item["metadata"].pop("managedFields", None)
    return found


class _Server:
    """An API server, with the certificates of a kubeconfig."""

    def __init__(self, config: dict[str, Any]) -> None:
        cluster, user = config["clusters"][0]["cluster"], config["users"][0]["user"]
        self._host = urlsplit(cluster["server"]).netloc
        self._context = ssl.create_default_context(cafile=cluster["certificate-authority"])
        self._context.load_cert_chain(user["client-certificate"], user["client-key"])

    def ask(self, path: str) -> dict[str, Any] | None:
        """Return the answer to a request; None if it fails."""
        connection = HTTPSConnection(self._host, timeout=20, context=self._context)
        try:
            connection.request("GET", path)
            answer = connection.getresponse()
            content = answer.read()
        except (OSError, HTTPException):
            return None
        finally:
            connection.close()
        found: dict[str, Any] | None = json.loads(content) if answer.status == 200 else None
        return found
