"""The commands that Docker and Podman have in common."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable

from robovast.base.errors import CannotRunError

ENGINES = ("docker", "podman")
IMAGE = r"^[^\s-]\S*$"
"""Pattern of an image reference; one that begins with `-` would be an option of the engine."""


class Result:
    """Result of a command."""

    def __init__(self, process: subprocess.CompletedProcess[str]) -> None:
        self.exit_code = process.returncode
        self.ok = process.returncode == 0
        self.output = process.stdout
        self.errors = process.stderr

    @property
    def last_error(self) -> str:
        """The last line that is not empty."""
        lines = [line for line in self.errors.strip().splitlines() if line.strip()]
        return lines[-1].strip() if lines else "no message"


def call(command: list[str]) -> Result:
    """Run a command to its end."""
    return Result(subprocess.run(command, capture_output=True, text=True, check=False))


def engine_answers(engine: str) -> bool:
    """Whether the program is installed and its daemon, if it has one, responds."""
    if shutil.which(engine) is None:
        return False
    return call([engine, "info", "--format", "{{.Driver}}{{.Store.GraphDriverName}}"]).ok or (
        call([engine, "info"]).ok
    )


def check_engine(engine: str, instead: str) -> None:
    """Check that containers can be started.

    Args:
        engine: `docker` or `podman`.
        instead: an alternative for the user, as the end of a sentence.

    Raises:
        CannotRunError: it is not installed, or does not respond.
    """
    if shutil.which(engine) is None:
        raise CannotRunError(f"`{engine}` is not installed", hint=f"install it, or {instead}")
    result = call([engine, "info"])
    if not result.ok:
        raise CannotRunError(
            f"{engine} does not answer ({result.last_error})",
            hint=f"check that its daemon is running and that you may use it, or {instead}",
        )


def fetch_image(engine: str, image: str, message: Callable[[str], None], build: str) -> None:
    """Pull an image unless it is on this machine.

    Args:
        engine: `docker` or `podman`.
        image: name of the image.
        message: called when the image is pulled.
        build: how to build the image, as the end of a sentence.

    Raises:
        CannotRunError: the image's name is not valid, or the image cannot be pulled.
    """
    if not re.match(IMAGE, image):
        raise CannotRunError(
            f"`{image}` is not a valid image name: it is empty, has spaces or begins with `-`",
            hint="choose an image with `--image`",
        )
    if call([engine, "image", "inspect", image]).ok:
        return
    message(f"Pulling {image} …")
    result = call([engine, "pull", "--quiet", image])
    if not result.ok:
        raise CannotRunError(
            f"the image {image} is not on this machine and cannot be pulled: {result.last_error}",
            hint=f"check its name, log in to its registry, or {build}",
        )


def named_digest(image: str) -> str:
    """The digest in an image's name, else empty.

    Such an image is verified when it is pulled. A tag proves nothing: two nodes may have pulled it
    at different times.
    """
    name, at, digest = image.partition("@")
    folder, slash, last = name.rpartition("/")
    return f"{folder}{slash}{last.partition(':')[0]}@{digest}" if at else ""


def image_digest(engine: str, image: str) -> str:
    """Digest of an image, or its local id if it has none."""
    pattern = "{{if .RepoDigests}}{{index .RepoDigests 0}}{{else}}{{.Id}}{{end}}"
    return call([engine, "image", "inspect", "-f", pattern, image]).output.strip()
