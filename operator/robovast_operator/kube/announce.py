"""Creates Events; one that the API server refuses stops nothing else."""

from __future__ import annotations

import logging

from robovast_operator.kube import paths
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.events import EventContent, event
from robovast_operator.kube.objects import Identity
from robovast_operator.kube.times import format_time, now

LOGGER = logging.getLogger(__name__)


def is_refusal(error: ApiError) -> bool:
    """Return whether the server refuses this request, but would accept others in the namespace."""
    return 400 <= error.code < 500 and not error.terminating


async def announce(api: Api, identity: Identity, message: EventContent) -> None:
    """Create an Event about a Campaign; of two about the same thing, the first stays.

    Raises:
        ApiError: it is unknown whether the Event exists, or the namespace is being deleted.
    """
    try:
        created = event(identity, message, format_time(now()))
        await api.create(paths.events(identity.namespace), created)
    except ApiError as error:
        if not is_refusal(error):
            raise
        LOGGER.warning("%s/%s: no Event: %s", identity.namespace, identity.name, error)
