"""Docker and Podman, as far as they have the same commands."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable

from robovast.base.errors import CannotRunError

ENGINES = ("docker", "podman")


class Result:
    """What a command has said."""

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
    """True when the program is installed and its daemon, if it has one, answers."""
    if shutil.which(engine) is None:
        return False
    return call([engine, "info", "--format", "{{.Driver}}{{.Store.GraphDriverName}}"]).ok or (
        call([engine, "info"]).ok
    )


def check_engine(engine: str, instead: str) -> None:
    """Make sure that containers can be started.

    Args:
        engine: `docker` or `podman`.
        instead: what else the user can do, as the end of a sentence.

    Raises:
        CannotRunError: it is not installed, or does not answer.
    """
    if shutil.which(engine) is None:
        raise CannotRunError(f"there is no `{engine}` here: install it, or {instead}.")
    result = call([engine, "info"])
    if not result.ok:
        raise CannotRunError(
            f"{engine} does not answer ({result.last_error}). Is its daemon running, and may "
            f"you use it? Or {instead}."
        )


def fetch_image(engine: str, image: str, message: Callable[[str], None], build: str) -> None:
    """Make sure that an image is on this machine.

    Args:
        engine: `docker` or `podman`.
        image: its name.
        message: is told when it is pulled.
        build: how one makes it, as the end of a sentence.

    Raises:
        CannotRunError: it cannot be pulled.
    """
    if call([engine, "image", "inspect", image]).ok:
        return
    message(f"Pulling {image} …")
    result = call([engine, "pull", "--quiet", image])
    if not result.ok:
        raise CannotRunError(
            f"the image {image} is not on this machine and cannot be pulled: "
            f"{result.last_error}. Check its name, log in to its registry, or {build}."
        )


def named_digest(image: str) -> str:
    """What tells an image from others of its name, where its name says that; else empty.

    What is named so is what runs, since it is verified when it is pulled. A tag says nothing:
    two nodes may have pulled it at different times.
    """
    name, at, digest = image.partition("@")
    folder, slash, last = name.rpartition("/")
    return f"{folder}{slash}{last.partition(':')[0]}@{digest}" if at else ""


def image_digest(engine: str, image: str) -> str:
    """What tells an image from others of its name."""
    pattern = "{{if .RepoDigests}}{{index .RepoDigests 0}}{{else}}{{.Id}}{{end}}"
    return call([engine, "image", "inspect", "-f", pattern, image]).output.strip()
