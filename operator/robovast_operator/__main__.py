"""`python -m robovast_operator`: kopf as the shell around the operator."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Iterator
from itertools import chain, repeat
from typing import Any

import kopf

from robovast.base.errors import RobovastError
from robovast.kubeapi.resources import GROUP, MANAGED_BY, MANAGED_LABEL, VERSION
from robovast_operator.kube import malloc as heap
from robovast_operator.kube.api import server
from robovast_operator.operator import Operator
from robovast_operator.settings import OperatorSettings, read_settings

LOGGER = logging.getLogger(__name__)


DEEPEST = 12_000
"""Recursion limit: an API server accepts 10,000 levels, and no object must end a watch."""


class Handlers:
    """The functions that kopf calls: they only pass events on, and never raise.

    All are coroutines, since kopf calls plain functions in threads, and the store belongs
    to the event loop.
    """

    def __init__(self, own: OperatorSettings) -> None:
        self._own = own
        self._operator: Operator | None = None

    async def startup(self, settings: kopf.OperatorSettings, **_: Any) -> None:
        """Start the operator, before the first event."""
        configure(settings, self._own)
        self._operator = Operator(self._own)
        await self._operator.start()
        settings.watching.initial_streaming = await self._operator.can_stream_lists()

    async def cleanup(self, **_: Any) -> None:
        """Stop the operator, after the last event."""
        if self._operator is not None:
            await self._operator.stop()

    async def campaign(self, event: Any, **_: Any) -> None:
        """Handle a change of a Campaign."""
        self._pass_on("campaign_event", event)

    async def configuration(self, event: Any, **_: Any) -> None:
        """Handle a change of a Configuration."""
        self._pass_on("configuration_event", event)

    async def job(self, event: Any, **_: Any) -> None:
        """Handle a change of a Job."""
        self._pass_on("job_event", event)

    def _pass_on(self, name: str, event: Any) -> None:
        try:
            getattr(self._operator, name)(event["type"], event["object"])
        except Exception:  # what escapes would end the watch stream
            LOGGER.exception("an event could not be taken")


class NoDifferences(kopf.StatusDiffBaseStorage):
    """Keeps kopf from comparing objects, which no handler of ours asks for.

    It would copy each object five times for that, which costs more than all that we do with it.
    """

    def build(self, **_: Any) -> kopf.BodyEssence:
        """Return the parts of an object to compare: none."""
        return kopf.BodyEssence({})


class Patience:
    """Pauses between kopf's attempts at a request [s]: short ones, without end."""

    def __iter__(self) -> Iterator[float]:
        return chain((0.5, 1.0, 2.0), repeat(4.0))


def configure(settings: kopf.OperatorSettings, own: OperatorSettings) -> None:
    """Configure kopf to watch only, without finalizers, annotations, events and peering."""
    settings.posting.enabled = False
    settings.scanning.disabled = True
    settings.peering.standalone = True
    settings.networking.request_timeout = 15
    settings.networking.error_backoffs = Patience()
    settings.persistence.diffbase_storage = NoDifferences()
    settings.queueing.idle_timeout = 1  # it holds the last object of each key for so long
    settings.watching.server_timeout = 600
    settings.watching.inactivity_timeout = own.silence_seconds
    settings.watching.label_selectors["jobs"] = f"{MANAGED_LABEL}={MANAGED_BY}"
    logging.getLogger("kopf.objects").setLevel(logging.WARNING)


def login(**_: Any) -> kopf.ConnectionInfo:
    """Give kopf the same access to the API server that the operator has."""
    to = server()
    scheme, _, token = to.api_key.get("BearerToken", "").partition(" ")
    return kopf.ConnectionInfo(
        server=to.host,
        ca_path=to.ssl_ca_cert,
        insecure=not to.verify_ssl,
        certificate_path=to.cert_file,
        private_key_path=to.key_file,
        scheme=scheme or None,
        token=token.strip() or None,
    )


def main() -> None:
    """Run until a signal ends the process."""
    heap.adjust()
    sys.setrecursionlimit(DEEPEST)
    logging.basicConfig(
        level=os.environ.get("ROBOVAST_LOG_LEVEL", "INFO"),
        format="%(asctime)s %(levelname)s %(name)s: %(message)s",
    )
    try:
        own = read_settings()
    except RobovastError as error:
        sys.exit(f"robovast-operator: {error}")
    handlers = Handlers(own)
    registry = kopf.OperatorRegistry()
    kopf.on.startup(registry=registry)(handlers.startup)
    kopf.on.cleanup(registry=registry)(handlers.cleanup)
    kopf.on.login(registry=registry)(login)
    kopf.on.event(GROUP, VERSION, "campaigns", registry=registry)(handlers.campaign)
    kopf.on.event(GROUP, VERSION, "configurations", registry=registry)(handlers.configuration)
    kopf.on.event("batch", "v1", "jobs", registry=registry)(handlers.job)
    kopf.run(
        registry=registry,
        standalone=True,
        clusterwide=not own.namespaces,
        namespaces=own.namespaces,
    )


if __name__ == "__main__":
    main()
