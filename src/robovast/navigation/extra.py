"""Reports a missing extra `nav`."""

from __future__ import annotations

from contextlib import AbstractContextManager

from robovast.base.optional_deps import needing

_PACKAGES = {"PIL", "manifold3d", "numpy", "scipy", "shapely", "textx"}


def nav_extra(what: str) -> AbstractContextManager[None]:
    """Wraps imports from the extra `nav` that are needed for `what`."""
    return needing("nav", _PACKAGES, what)
