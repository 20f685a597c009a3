"""Which context and namespace a kubeconfig means, by the rules of kubectl."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import yaml

from robovast.base.errors import InputError


def choose(context: str | None, namespace: str | None) -> tuple[str | None, str | None]:
    """Context and namespace: as given, else those of the kubeconfig; None where it has none.

    The files of `$KUBECONFIG` count together, the first that says something wins.

    Raises:
        InputError: a file cannot be read.
    """
    told = (file.get("current-context") for file in _all())
    chosen = context or next(filter(None, told), None)
    found = _entry("context", chosen)
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
    """What the kubeconfig says of a context or user; None when it does not know it."""
    known = (item for file in _all() for item in file.get(f"{kind}s") or ())
    return next((item.get(kind) or {} for item in known if item.get("name") == name), None)


def _all() -> list[dict[str, Any]]:
    return [_read(Path(name).expanduser()) for name in files().split(os.pathsep) if name]


def _read(path: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise InputError(f"{path}: cannot be read as a kubeconfig: {error}") from error
    return data if isinstance(data, dict) else {}
