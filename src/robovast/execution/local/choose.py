"""Chooses the runtime that executes the runs, and its image."""

from __future__ import annotations

import os
from collections.abc import Callable

from robovast.base.containers import ENGINES, engine_answers
from robovast.base.errors import CannotRunError, InputError
from robovast.execution.local.container_runtime import ContainerRuntime
from robovast.execution.local.events import LocalOptions
from robovast.execution.local.process_runtime import ProcessRuntime
from robovast.execution.local.runtime import Runtime
from robovast.model.document import Document

RUNTIMES = (*ENGINES, "process", "auto")


def resolve_image(document: Document, options: LocalOptions) -> str | None:
    """The image of the option, of `ROBOVAST_IMAGE`, or of the document, in this order."""
    return options.image or os.environ.get("ROBOVAST_IMAGE") or document.vast.execution.image


def choose_runtime(
    document: Document, options: LocalOptions, message: Callable[[str], None]
) -> Runtime:
    """The chosen runtime; `auto` means the first that is available of docker, podman, process.

    Raises:
        InputError: the runtime does not exist.
        CannotRunError: a container runtime was chosen without an image.
    """
    image = resolve_image(document, options)
    if options.runtime not in RUNTIMES:
        raise InputError(f"`{options.runtime}` is not a runtime; there are {', '.join(RUNTIMES)}.")
    if options.runtime == "process":
        return ProcessRuntime(message, options.process_environment)
    if options.runtime == "auto":
        return _first_available(image, options, message)
    if image is None:
        raise CannotRunError(
            f"{options.runtime} needs a container image: give `--image`, ROBOVAST_IMAGE or "
            f"`execution.image` in {document.path}; or use `--runtime process`."
        )
    return ContainerRuntime(options.runtime, image, options, message)


def _first_available(
    image: str | None, options: LocalOptions, message: Callable[[str], None]
) -> Runtime:
    if image is None:
        message("Running as plain processes: no container image is named.")
        return ProcessRuntime(message, options.process_environment)
    for engine in ENGINES:
        if engine_answers(engine):
            message(f"Running in {engine} with {image}.")
            return ContainerRuntime(engine, image, options, message)
    message(f"Running as plain processes: no Docker or Podman answers, so {image} is not used.")
    return ProcessRuntime(message, options.process_environment)
