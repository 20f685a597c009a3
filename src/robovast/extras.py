"""What to say when a package of an optional extra is not installed."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator

from robovast.errors import CannotRunError


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
        raise CannotRunError(
            f"{what} needs the extra `{extra}` ({package} is not installed): "
            f"pip install 'robovast[{extra}]'."
        ) from None
