"""Containers that variation types start during expansion."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NoReturn

from robovast.base.containers import (
    ENGINES,
    call,
    check_engine,
    engine_answers,
    fetch_image,
    image_digest,
)
from robovast.base.errors import CannotRunError, InputError

_LINES = 15
"""Most lines of a container's output that an error shows."""


class ContainerRunner:
    """Starts containers of one image with the first of Docker and Podman that works.

    Args:
        image: name of the image; it is pulled if it is missing.
        message: receives progress messages.

    Raises:
        CannotRunError: no engine works, or the image cannot be pulled.
    """

    def __init__(self, image: str, message: Callable[[str], None]) -> None:
        self.image = image
        self.engine = _engine()
        fetch_image(self.engine, image, message, "build it")

    @cached_property
    def digest(self) -> str:
        """Digest of the image."""
        return image_digest(self.engine, self.image)

    def run(self, arguments: Sequence[str], volumes: Sequence[str]) -> str:
        """Start a container without network access and wait until it ends.

        Args:
            arguments: arguments of the image's entry point.
            volumes: `source:target[:ro]` with absolute paths; written files belong to the user.

        Returns:
            The container's standard output.

        Raises:
            InputError: the container failed; the message includes the end of its output.
        """
        owner = ["--userns=keep-id"] if self.engine == "podman" else []
        user = ["--user", f"{os.getuid()}:{os.getgid()}"]
        mounts = [word for volume in volumes for word in ("--volume", volume)]
        options = ["--rm", "--init", "--network=none", "--env=HOME=/tmp", *owner, *user, *mounts]
        result = call([self.engine, "run", *options, self.image, *arguments])
        if not result.ok:
            lines = (result.output + result.errors).strip().splitlines() or ["no message"]
            said = "\n    ".join(lines[-_LINES:])
            raise InputError(
                f"the container of {self.image} failed with exit code {result.exit_code}:\n"
                f"    {said}"
            )
        return result.output


Containers = Callable[[str, Callable[[str], None]], ContainerRunner]
"""Creates container runners for variation types."""


def refuse_containers(image: str, message: Callable[[str], None]) -> NoReturn:
    """Refuse to start containers, where that is impossible: on a cluster.

    Raises:
        CannotRunError: always.
    """
    del message
    raise CannotRunError(
        f"it needs a container of {image} to create its files, and a cluster does not start such "
        "containers",
        hint="expand the .vast file on a machine with Docker or Podman (`vast config generate "
        "OUT`) and name the created files, or do not use the container",
    )


def _engine() -> str:
    installed = [engine for engine in ENGINES if shutil.which(engine)]
    if not installed:
        raise CannotRunError(
            f"neither {' nor '.join(ENGINES)} is installed",
            hint="install one, or do without the container",
        )
    answering = next(filter(engine_answers, installed), None)
    if answering is None:
        check_engine(installed[0], "do without the container")
    return answering or installed[0]
