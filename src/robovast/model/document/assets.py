"""Files that the pods of runs mount, read only, from a volume of the cluster."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from robovast.base.containers import IMAGE
from robovast.model.document.section import Section

MOST_ASSETS = 10
"""Most volumes of a campaign."""

CLOSED = ("/config", "/out", "/dev", "/etc", "/proc", "/run", "/sys")
"""Folders of the run contract and of the system: nothing may be mounted in them."""

NEEDED = ("/bin", "/lib", "/lib64", "/sbin", "/tmp", "/usr/bin", "/usr/lib", "/ws/install")  # noqa: S108
"""Folders of the image that runs need: they may not be hidden; below them there is room."""


def _check_path(value: str) -> str:
    path = PurePosixPath(value)
    plain = str(path) == value and path.is_absolute() and not value.startswith("//")
    if not plain or ".." in path.parts or ":" in value or not value.isprintable():
        raise PydanticCustomError("assets_path", "must be an absolute path, such as `/assets`")
    hidden = [one for one in (*CLOSED, *NEEDED) if PurePosixPath(one).is_relative_to(path)]
    hidden += [one for one in CLOSED if path.is_relative_to(one)]
    if hidden:
        raise PydanticCustomError(
            "assets_hide",
            "a mount at `{path}` would hide `{hidden}`, which runs need; choose another path, "
            "such as `/assets`",
            {"path": value, "hidden": hidden[0]},
        )
    return value


class Assets(Section):
    """Read-only files for all containers of a run, from a volume or an image."""

    path: Annotated[str, Field(pattern=r"^/", max_length=253), AfterValidator(_check_path)]
    """Path in the containers, such as `/assets`."""
    claim: Annotated[str, Field(pattern=r"^[a-z0-9][-a-z0-9.]{0,252}$")] | None = None
    """PersistentVolumeClaim of the namespace with the label `robovast.io/assets: "true"`."""
    image: Annotated[str, Field(pattern=IMAGE, max_length=500)] | None = None
    """Container image that contains the files, preferably with its digest."""

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        if (self.claim is None) == (self.image is None):
            raise PydanticCustomError("assets_place", "has either a `claim` or an `image`")
        return self


def check_apart(assets: list[Assets]) -> list[Assets]:
    """Make sure that none hides another.

    Raises:
        PydanticCustomError: one does.
    """
    paths = [PurePosixPath(one.path) for one in assets]
    for number, path in enumerate(paths):
        for other in paths[:number]:
            if path.is_relative_to(other) or other.is_relative_to(path):
                raise PydanticCustomError(
                    "assets_apart",
                    "`{one}` and `{other}` would hide each other; use folders that do not "
                    "contain each other",
                    {"one": str(path), "other": str(other)},
                )
    return assets
