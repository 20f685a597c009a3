"""What a document asks for of a pod, checked by client and operator alike."""

from __future__ import annotations

from robovast.model.document.execution import Execution, Resources
from robovast.model.quantities import (
    cpus,
    disk,
    gpu_resource,
    gpus,
    memory_limit,
    shared_memory,
)


def check_amounts(execution: Execution, context: str, most_disk: str = "") -> None:
    """Make sure that a pod can be asked for.

    Args:
        execution: the section of the document.
        context: of the cluster.
        most_disk: disk of a pod that the installation allows; anything when empty.

    Raises:
        InputError: an amount is none, there is none for this cluster, or it is not allowed.
    """
    main, kubernetes = execution.resources, execution.kubernetes
    containers: list[tuple[str, Resources]] = [("execution", main)]
    containers += [(s.name, s.resources) for s in execution.secondary_containers]
    for name, resources in containers:
        cpus(resources.cpu, f"resources.cpu of {name}", context)
        memory_limit(resources.memory, f"resources.memory of {name}", context)
        gpus(resources.gpu, f"resources.gpu of {name}", context)
    shared_memory(main.shm_size, main.memory, context)
    gpu_resource(kubernetes.gpu_resource, context)
    disk(kubernetes.ephemeral_storage, context, most_disk)
