"""What to say when the extra `nav` is not installed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from robovast.errors import CannotRunError

_PACKAGES = {"PIL", "manifold3d", "numpy", "scipy", "shapely", "textx"}


@contextlib.contextmanager
def nav_extra(what: str) -> Iterator[None]:
    """Where packages of the extra are imported: one that is missing is reported by the extra.

    Args:
        what: what needs it, as the beginning of a sentence.

    Raises:
        CannotRunError: a package of the extra is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in _PACKAGES:
            raise
        raise CannotRunError(
            f"{what} needs the extra `nav` ({package} is not installed): "
            "pip install 'robovast[nav]'."
        ) from None
