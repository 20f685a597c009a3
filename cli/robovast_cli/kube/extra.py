"""The extra `cluster`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from robovast.base.errors import CannotRunError


@contextmanager
def cluster_extra() -> Iterator[None]:
    """Imports that need the extra `cluster`."""
    try:
        yield
    except ImportError as error:
        raise CannotRunError(
            f"the package {error.name} is missing: install `robovast[cluster]`."
        ) from None
