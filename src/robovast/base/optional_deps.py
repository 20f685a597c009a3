"""Optional dependencies: errors that name the extra to install."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec

from robovast.base.errors import CannotRunError


@dataclass(frozen=True)
class Extra:
    """Optional packages of one extra."""

    name: str
    packages: tuple[str, ...]
    """The packages' import names; with dots where several packages share a folder."""

    def require(self, what: str) -> None:
        """Check that the packages are installed, without importing them.

        Args:
            what: the feature that needs them, as the beginning of a sentence.

        Raises:
            CannotRunError: a package is not installed.
        """
        for package in self.packages:
            if not _is_installed(package):
                raise self.missing(package, what)

    @contextlib.contextmanager
    def needed_by(self, what: str) -> Iterator[None]:
        """Wrap imports from the extra; a missing package becomes an error that names the extra.

        Args:
            what: the feature that needs it, as the beginning of a sentence.

        Raises:
            CannotRunError: a package of the extra is not installed.
        """
        try:
            yield
        except ModuleNotFoundError as error:
            package = self.lacking(error)
            if package is None:
                raise
            raise self.missing(package, what) from None

    def lacking(self, error: ModuleNotFoundError) -> str | None:
        """Return the package of the extra that an import did not find; None if it is another."""
        parts = (error.name or "").split(".")
        for package in self.packages:
            names = package.split(".")
            if all(part == name for part, name in zip(parts, names, strict=False)):
                return package
        return None

    def missing(self, package: str, what: str) -> CannotRunError:
        """Return the error about a package of the extra that is not installed."""
        from robovast.base.installation import install_command

        return CannotRunError(
            f"{what} needs the extra `{self.name}` ({package} is not installed)",
            hint=f"run `{install_command(self.name)}`",
        )


ANALYSIS = Extra("analysis", ("matplotlib", "pandas"))
CLUSTER = Extra("cluster", ("anyio", "certifi", "dotenv", "kubernetes", "minio", "urllib3"))
GCS = Extra(
    "gcs",
    (
        *("certifi", "dotenv", "google.api_core", "google.auth", "google.cloud.storage"),
        *("google.resumable_media", "requests", "urllib3"),
    ),
)
GUI = Extra("gui", ("starlette", "uvicorn"))
MCP = Extra("mcp", ("anyio", "fastmcp"))
NAV = Extra("nav", ("manifold3d", "numpy", "PIL", "scipy", "shapely", "textx"))
NOTEBOOKS = Extra("notebooks", ("ipykernel", "jupyter_client", "nbclient", "nbconvert", "nbformat"))
OPERATOR = Extra("operator", ("aiohttp", "kopf", "kubernetes", "prometheus_client"))
OPTUNA = Extra("optuna", ("cmaes", "numpy", "optuna"))
QUERY = Extra("query", ("duckdb", "fsspec", "pyoxigraph"))
RERUN = Extra("rerun", ("rerun_cli",))
ROS = Extra("ros", ("lz4", "mcap", "numpy", "orjson", "rosbags", "zstandard"))
SEARCH = Extra("search", ("numpy", "scipy"))
SHARE = Extra("share", ("certifi", "dotenv", "paramiko", "urllib3"))
VIDEO = Extra("video", ("av",))

EXTRAS = (
    *(SHARE, CLUSTER, NAV, ROS, SEARCH, OPTUNA, QUERY),
    *(GUI, NOTEBOOKS, MCP, ANALYSIS, VIDEO, RERUN, GCS, OPERATOR),
)
"""All extras; of those that share a package, the first is named if the feature is unknown."""


def missing_extra(error: BaseException, what: str = "This feature") -> CannotRunError | None:
    """Return the error for users if an import failed because an extra is missing, else None."""
    if not isinstance(error, ModuleNotFoundError):
        return None
    for extra in EXTRAS:
        if package := extra.lacking(error):
            return extra.missing(package, what)
    return None


def _is_installed(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except ModuleNotFoundError:  # its folder is missing
        return False
