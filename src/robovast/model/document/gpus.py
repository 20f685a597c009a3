"""Whether a document says what GPUs are and asks for none: a campaign without them by mistake."""

from __future__ import annotations

from robovast.base.errors import DocumentError
from robovast.model.document.execution import Execution
from robovast.model.document.loader import Document

NO_GPU = "no container requests `gpu`, so pods would get no GPU"
REMEDY = "Add `gpu` to `execution.resources`, or remove `gpu_resource`."


def asks_in_vain(execution: Execution) -> bool:
    """Whether GPUs are named and none is asked for; `gpu: 0` is a decision."""
    containers = [execution.resources, *(c.resources for c in execution.secondary_containers)]
    named = "gpu_resource" in execution.kubernetes.model_fields_set
    return named and all(asked.gpu is None for asked in containers)


def check_gpus(document: Document) -> None:
    """Refuse a document that is to begin and names GPUs without asking for any.

    Raises:
        DocumentError: it does.
    """
    if asks_in_vain(document.vast.execution):
        place = ("execution", "kubernetes", "gpu_resource")
        raise DocumentError([document.source.problem(place, NO_GPU, REMEDY, at_key=True)])
