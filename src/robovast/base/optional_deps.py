"""Optional dependencies: errors that name the extra to install."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from importlib.util import find_spec

from robovast.base.errors import CannotRunError


@dataclass(frozen=True)
class Extra:
    """Optional packages of one extra."""

    name: str
    packages: tuple[str, ...]
    """The packages' import names."""

    def require(self, what: str) -> None:
        """Check that the packages are installed, without importing them.

        Args:
            what: the feature that needs them, as the beginning of a sentence.

        Raises:
            CannotRunError: a package is not installed.
        """
        for package in self.packages:
            if find_spec(package) is None:
                raise _missing(self.name, package, what)


ROS = Extra("ros", ("lz4", "mcap", "numpy", "orjson", "rosbags", "zstandard"))
VIDEO = Extra("video", ("av",))


@contextlib.contextmanager
def needing(extra: str, packages: Collection[str], what: str) -> Iterator[None]:
    """Wrap imports from an extra; a missing package becomes an error that names the extra.

    Args:
        extra: name of the extra.
        packages: the extra's packages by import name.
        what: the feature that needs it, as the beginning of a sentence.

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
