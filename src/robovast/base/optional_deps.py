"""Errors that say which extra is to be installed for an optional dependency."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from importlib.util import find_spec

from robovast.base.errors import CannotRunError


@dataclass(frozen=True)
class Extra:
    """Optional packages under one name."""

    name: str
    packages: tuple[str, ...]
    """By the names that are imported."""

    def require(self, what: str) -> None:
        """Look for the packages, without importing any.

        Args:
            what: what needs them, as the beginning of a sentence.

        Raises:
            CannotRunError: one is not installed.
        """
        for package in self.packages:
            if find_spec(package) is None:
                raise _missing(self.name, package, what)


ROS = Extra("ros", ("lz4", "mcap", "numpy", "orjson", "rosbags", "zstandard"))
VIDEO = Extra("video", ("av",))


@contextlib.contextmanager
def needing(extra: str, packages: Collection[str], what: str) -> Iterator[None]:
    """Where packages of an extra are imported: one that is missing is reported by the extra.

    Args:
        extra: its name.
        packages: of the extra, by the names that are imported.
        what: what needs it, as the beginning of a sentence.

    Raises:
        CannotRunError: a package of the extra is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in packages:
            raise
        raise _missing(extra, package, what) from None


def _missing(extra: str, package: str, what: str) -> CannotRunError:
    return CannotRunError(
        f"{what} needs the extra `{extra}` ({package} is not installed): "
        f"pip install 'robovast[{extra}]'."
    )
