"""Containers that variation types start while a document is expanded."""

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
"""Most lines of a container's output in an error."""


class ContainerRunner:
    """Starts containers of one image, by the first of docker and podman that answers.

    Args:
        image: its name; it is pulled when it is not here.
        message: is told what goes on.

    Raises:
        CannotRunError: no engine answers, or the image is not to be had.
    """

    def __init__(self, image: str, message: Callable[[str], None]) -> None:
        self.image = image
        self.engine = _engine()
        fetch_image(self.engine, image, message, "build it")

    @cached_property
    def digest(self) -> str:
        """What tells the image from others of its name."""
        return image_digest(self.engine, self.image)

    def run(self, arguments: Sequence[str], volumes: Sequence[str]) -> str:
        """Start a container without network and wait for its end.

        Args:
            arguments: of its entry point.
            volumes: `source:target[:ro]`, with absolute paths; what it writes belongs to the user.

        Returns:
            What it wrote to its standard output.

        Raises:
            InputError: it failed; with its own last words.
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
"""Gives variation types what starts containers of an image."""


def refuse_containers(image: str, message: Callable[[str], None]) -> NoReturn:
    """For places that cannot start containers: a cluster.

    Raises:
        CannotRunError: always.
    """
    del message
    raise CannotRunError(
        f"it needs a container of {image} to make its files, and a cluster starts none for that. "
        "Expand the document on a machine with Docker or Podman (`vast config generate OUT`) and "
        "name the files that it makes, or do without the container."
    )


def _engine() -> str:
    installed = [engine for engine in ENGINES if shutil.which(engine)]
    if not installed:
        raise CannotRunError(
            f"neither {' nor '.join(ENGINES)} is here: install one, or do without the container."
        )
    answering = next(filter(engine_answers, installed), None)
    if answering is None:
        check_engine(installed[0], "do without the container")
    return answering or installed[0]
