"""Which context and namespace a kubeconfig means, by the rules of kubectl."""

from __future__ import annotations

import os
import re
from pathlib import Path
from shlex import quote
from typing import Any

from robovast.base.errors import CannotRunError, InputError
from robovast.kubeapi.resources import DNS_LABEL
from robovast.model.document.source import Source


def options_of(context: str | None, namespace: str | None) -> str:
    """What chooses a cluster in a command that is printed: ` --context a --namespace lab`.

    Args:
        context: as it was given; None is the current one.
        namespace: as it was given; the context's when None.
    """
    given = {"context": context, "namespace": namespace}
    return "".join(f" --{name} {quote(value)}" for name, value in given.items() if value)


def choose(context: str | None, namespace: str | None) -> tuple[str | None, str | None]:
    """Context and namespace: as given, else those of the kubeconfig; None where it has none.

    The files of `$KUBECONFIG` are merged; the first value wins.

    Raises:
        InputError: a file cannot be read, or no namespace can have that name.
        CannotRunError: there is no such context.
    """
    if namespace and not re.fullmatch(DNS_LABEL, namespace):
        raise InputError(
            f"`{namespace}` is not a valid namespace name", hint="use only a-z, 0-9 and `-`"
        )
    told = (file.get("current-context") for file in _all())
    chosen = context or next(filter(None, told), None)
    found = _entry("context", chosen)
    if found is None and chosen:
        known = (item.get("name") for file in _all() for item in file.get("contexts") or ())
        raise CannotRunError(
            f"the context `{chosen}` does not exist in your kubeconfig ($KUBECONFIG, else "
            f"~/.kube/config); it has {', '.join(map(str, known)) or 'none'}.",
            hint="select a context with `--context`",
        )
    if found is None:
        return chosen, namespace
    return chosen, namespace or found.get("namespace") or "default"


def login_program(context: str) -> str:
    """The program that gives the key of a context's user; empty when there is none."""
    user = _entry("user", (_entry("context", context) or {}).get("user")) or {}
    return str((user.get("exec") or {}).get("command") or "")


def files() -> str:
    """The names of the kubeconfig's files, as `$KUBECONFIG` writes them."""
    return os.environ.get("KUBECONFIG") or "~/.kube/config"


def _entry(kind: str, name: str | None) -> dict[str, Any] | None:
    """The kubeconfig's entry for a context or user; None if it is missing."""
    known = (item for file in _all() for item in file.get(f"{kind}s") or ())
    return next((item.get(kind) or {} for item in known if item.get("name") == name), None)


def _all() -> list[dict[str, Any]]:
    return [_read(Path(name).expanduser()) for name in files().split(os.pathsep) if name]


def _read(path: Path) -> dict[str, Any]:
    data = (path.exists() and Source.read(path).data) or {}
    if not isinstance(data, dict):
        raise InputError(
            f"{path} is not a valid kubeconfig: it contains no mapping.",
            hint="set $KUBECONFIG to a kubeconfig, or create one with the tool of your cluster",
        )
    return data
