"""RoboVAST's Helm chart, and Helm."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

import robovast
from robovast.base.errors import CannotRunError
from robovast.base.serialization import dump_yaml

RELEASE = "robovast"
"""Name of the Helm release."""
TIMEOUT = "10m"
"""Time limit for the chart's pods to become ready."""

_PACKAGE = Path(robovast.__file__).parent


def chart_folder() -> Path:
    """Return the folder of the chart, in the package or in its checkout.

    Raises:
        CannotRunError: the chart is missing.
    """
    for folder in (_PACKAGE / "chart", _PACKAGE.parents[1] / "helm" / "robovast"):
        if (folder / "Chart.yaml").is_file():
            return folder
    raise CannotRunError(
        "the Helm chart is missing from this installation of RoboVAST.",
        hint="install RoboVAST again",
    )


class Helm:
    """The program `helm`, for one namespace of one cluster."""

    def __init__(self, namespace: str, context: str) -> None:
        self._where = ["--namespace", namespace, *(["--kube-context", context] if context else [])]

    def installed(self) -> str | None:
        """Return the description of the installed release, or None."""
        result = self._run("status", RELEASE, "--output", "json", check=False)
        if result.returncode:
            if "not found" in result.stderr:
                return None
            raise CannotRunError(f"helm: {result.stderr.strip()}")
        return str(json.loads(result.stdout).get("info", {}).get("description", ""))

    def install(self, values: Mapping[str, Any], description: str) -> None:
        """Install or upgrade the chart, and wait until its pods are ready.

        The values can contain credentials, so they are passed in a file.
        """
        with NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
            file.write(dump_yaml(values))
            file.flush()
            # CRDs remain after a release was deleted, and must be usable by the next one.
            self._run(
                *("upgrade", RELEASE, str(chart_folder()), "--install", "--create-namespace"),
                "--take-ownership",
                *("--values", file.name, "--wait", "--timeout", TIMEOUT),
                *("--description", description),
            )

    def uninstall(self) -> None:
        """Remove the release."""
        self._run("uninstall", RELEASE, "--wait", "--timeout", TIMEOUT)

    def _run(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        command = ["helm", *arguments, *self._where]
        try:
            result = subprocess.run(command, capture_output=True, text=True, check=False)
        except FileNotFoundError:
            raise CannotRunError(
                "`helm` is not installed",
                hint="install it (https://helm.sh/docs/intro/install/), or use `vast exec "
                "cluster prepare-setup` to write the files for Helm on another machine",
            ) from None
        if check and result.returncode:
            raise CannotRunError(f"`helm {arguments[0]}` failed: {result.stderr.strip()}")
        return result
