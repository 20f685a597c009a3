"""Select context and namespace of a kubeconfig, by the rules of kubectl."""

from __future__ import annotations

import os
import re
from pathlib import Path
from shlex import quote
from typing import Any

from robovast.base.errors import CannotRunError, InputError
from robovast.kubeapi.resources import DNS_LABEL
from robovast.model.document.source import Source


def cluster_options(context: str | None, namespace: str | None) -> str:
    """Return the options that select a cluster in a command: ` --context a --namespace lab`."""
    values = {"context": context, "namespace": namespace}
    return "".join(f" --{name} {quote(value)}" for name, value in values.items() if value)


def select_context(context: str | None, namespace: str | None) -> tuple[str | None, str | None]:
    """Return context and namespace (default: from the kubeconfig); None if it has none.

    The files of `$KUBECONFIG` are merged; the first value wins.

    Raises:
        InputError: a file cannot be read, or no namespace can have that name.
        CannotRunError: there is no such context.
    """
    if namespace and not re.fullmatch(DNS_LABEL, namespace):
        raise InputError(
            f"`{namespace}` is not a valid namespace name", hint="use only a-z, 0-9 and `-`"
        )
    current = (file.get("current-context") for file in _read_all())
    chosen = context or next(filter(None, current), None)
    found = _entry("context", chosen)
    if found is None and chosen:
        known = (item.get("name") for file in _read_all() for item in file.get("contexts") or ())
        raise CannotRunError(
            f"the context `{chosen}` does not exist in your kubeconfig ($KUBECONFIG, else "
            f"~/.kube/config); it has {', '.join(map(str, known)) or 'none'}.",
            hint="select a context with `--context`",
        )
    if found is None:
        return chosen, namespace
    return chosen, namespace or found.get("namespace") or "default"


def login_program(context: str) -> str:
    """Return the program that logs in the user of a context; empty if there is none."""
    user = _entry("user", (_entry("context", context) or {}).get("user")) or {}
    return str((user.get("exec") or {}).get("command") or "")


def files() -> str:
    """Return the names of the kubeconfig files in the form of `$KUBECONFIG`."""
    return os.environ.get("KUBECONFIG") or "~/.kube/config"


def _entry(kind: str, name: str | None) -> dict[str, Any] | None:
    """Return the entry of a context or user, or None."""
    known = (item for file in _read_all() for item in file.get(f"{kind}s") or ())
    return next((item.get(kind) or {} for item in known if item.get("name") == name), None)


def _read_all() -> list[dict[str, Any]]:
    return [_read(Path(name).expanduser()) for name in files().split(os.pathsep) if name]


def _read(path: Path) -> dict[str, Any]:
    data = (path.exists() and Source.read(path).data) or {}
    if not isinstance(data, dict):
        raise InputError(
            f"{path} is not a valid kubeconfig: it contains no mapping.",
            hint="set $KUBECONFIG to a kubeconfig, or create one with the tool of your cluster",
        )
    return data
