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
    files = [_read(Path(name).expanduser()) for name in _names()]
    chosen = context or next(filter(None, (file.get("current-context") for file in files)), None)
    known = [item for file in files for item in file.get("contexts") or ()]
    found = next((item.get("context") or {} for item in known if item.get("name") == chosen), None)
    if found is None:
        return chosen, namespace
    return chosen, namespace or found.get("namespace") or "default"


def _names() -> list[str]:
    value = os.environ.get("KUBECONFIG") or "~/.kube/config"
    return [name for name in value.split(os.pathsep) if name]


def _read(path: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise InputError(f"{path}: cannot be read as a kubeconfig: {error}") from error
    return data if isinstance(data, dict) else {}
