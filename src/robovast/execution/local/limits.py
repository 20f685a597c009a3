"""What a document limits the containers of a local run to."""

from __future__ import annotations

from dataclasses import replace

from robovast.base.errors import InputError
from robovast.execution.local.runtime import Limits
from robovast.model.document import Document
from robovast.model.document.execution import Execution, Resources
from robovast.model.document.gpus import check_gpus
from robovast.model.quantities import cpus, gpus, memory_limit, shared_memory


def check_limits(document: Document) -> None:
    """Make sure that containers can be limited so, before anything of a campaign is made.

    Raises:
        InputError: an amount is none, or there is none for this machine.
        DocumentError: GPUs are named, and none is asked for.
    """
    check_gpus(document)
    try:
        main_limits(document.vast.execution)
        secondary_limits(document.vast.execution)
    except InputError as error:
        message = f"{document.source.file}: {error.message}"
        raise InputError(message, hint=error.hint) from None


def main_limits(execution: Execution) -> Limits:
    """Limits of the main container."""
    resources = execution.resources
    shm = shared_memory(resources.shm_size, resources.memory)
    return replace(_limits(resources, "execution.resources"), shm=shm)


def secondary_limits(execution: Execution) -> dict[str, Limits]:
    """Limits of each secondary container."""
    return {
        container.name: _limits(container.resources, f"secondary container `{container.name}`")
        for container in execution.secondary_containers
    }


def _limits(resources: Resources, key: str) -> Limits:
    return Limits(
        cpus=cpus(resources.cpu, f"{key}.cpu"),
        memory=memory_limit(resources.memory, f"{key}.memory"),
        gpus=gpus(resources.gpu, f"{key}.gpu"),
    )
