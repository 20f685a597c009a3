"""The error for an extra `nav` that is not installed."""

from __future__ import annotations

from contextlib import AbstractContextManager

from robovast.base.optional_deps import needing

_PACKAGES = {"PIL", "manifold3d", "numpy", "scipy", "shapely", "textx"}


def nav_extra(what: str) -> AbstractContextManager[None]:
    """Where packages of the extra `nav` are imported, for `what`."""
    return needing("nav", _PACKAGES, what)
