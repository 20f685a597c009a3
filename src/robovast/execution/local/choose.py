"""Chooses the runtime that executes the runs, and its image."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from robovast.base.containers import ENGINES, engine_answers
from robovast.base.errors import CannotRunError, InputError
from robovast.base.plugins import plugin_files_refused
from robovast.campaign.imported import MARK, is_imported
from robovast.execution.local.container_runtime import ContainerRuntime
from robovast.execution.local.events import LocalOptions
from robovast.execution.local.process_runtime import ProcessRuntime
from robovast.execution.local.runtime import Runtime
from robovast.model.document import Document

RUNTIMES = (*ENGINES, "process", "auto")
CONTAINER = "container"
"""Like `auto`, but never plain processes: for campaigns that were imported."""


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
    if options.runtime not in {*RUNTIMES, CONTAINER}:
        raise InputError(
            f"`{options.runtime}` is not a valid runtime", hint=f"use one of {', '.join(RUNTIMES)}"
        )
    if options.runtime == "process":
        return ProcessRuntime(message, options.process_environment)
    if options.runtime in {"auto", CONTAINER}:
        return _first_available(image, options, message)
    if image is None:
        raise CannotRunError(
            f"{options.runtime} needs a container image",
            hint=f"set `--image`, ROBOVAST_IMAGE or `execution.image` in {document.path}, or use "
            "`--runtime process`",
        )
    return ContainerRuntime(options.runtime, image, options, message)


def _first_available(
    image: str | None, options: LocalOptions, message: Callable[[str], None]
) -> Runtime:
    engine = next(filter(engine_answers, ENGINES), None) if image is not None else None
    if image is not None and engine is not None:
        message(f"Running in {engine} with {image}.")
        return ContainerRuntime(engine, image, options, message)
    if options.runtime == CONTAINER:
        why = "no Docker or Podman answers" if image else "no container image is named (`--image`)"
        raise CannotRunError(
            f"the campaign was imported, so its runs need a container, but {why}",
            hint="if you trust the campaign, use `--runtime process`",
        )
    if image is None:
        message("Running as local processes, because no container image is named.")
        return ProcessRuntime(message, options.process_environment)
    message(
        f"Running as local processes without {image}, because Docker and Podman do not respond."
    )
    return ProcessRuntime(message, options.process_environment)


@contextmanager
def trusted_code(campaign: Path, options: LocalOptions) -> Iterator[None]:
    """Load no plugin from a file of an imported campaign: it would run outside of a container.

    Args:
        campaign: the campaign's folder.
        options: with runtime `process`, the user trusts the campaign.
    """
    if options.runtime == "process" or not is_imported(campaign):
        yield
        return
    remedy = f"Review it; if you trust the campaign, delete {campaign / MARK} or use "
    with plugin_files_refused(
        f"{campaign.name} was imported, and its plugins would run with your permissions outside "
        f"of a container. {remedy}`--runtime process`."
    ):
        yield
