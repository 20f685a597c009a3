"""Compares the store with the cluster, to find what a watch has missed."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from robovast_operator.kube import malloc as heap
from robovast_operator.kube.api import Api, ApiError
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import Id, id_of
from robovast_operator.kube.untrusted_fields import metadata
from robovast_operator.settings import OperatorSettings

LOGGER = logging.getLogger(__name__)

SETTLING_SECONDS = 2.0
"""A list counts as complete when nothing of it arrived for so long [s]."""

RETRY_SECONDS = 2.0
"""Pause between attempts at the first comparison [s]."""


@dataclass(frozen=True)
class WatchedKind:
    """A watched kind of objects."""

    name: str
    path: Callable[[str | None], str]
    """Of the collection in a namespace, or in all."""
    stored: Callable[[], Iterator[tuple[Id, str]]]
    """Return the stored objects with their resource versions."""
    has: Callable[[Id], bool]
    """Whether the store has an object."""
    learn: Callable[[Object], None]
    forget: Callable[[Id], None]
    selection: Mapping[str, str] = field(default_factory=dict)
    """Parameters of the list."""


class Resync:
    """Compares all kinds periodically, and soon after a watch had to start with a list."""

    def __init__(
        self, api: Api, settings: OperatorSettings, kinds: tuple[WatchedKind, ...]
    ) -> None:
        self._api = api
        self._settings = settings
        self._kinds = kinds
        self._listed = asyncio.Event()
        self._misses = 0
        self.complete = asyncio.Event()
        """Set when the store has everything that existed at the start."""
        self.dead_watch = ""
        """The watch that missed changes twice in a row, if any."""

    def listed(self) -> None:
        """Note that a watch sent a list, which cannot contain earlier deletions."""
        self._listed.set()

    async def keep(self) -> None:
        """Load everything, then compare periodically, without end."""
        while not await self._compared():
            await asyncio.sleep(RETRY_SECONDS)
        self._misses = 0  # no watch has sent an event yet
        self.complete.set()
        while True:
            period = self._settings.resync_seconds * random.uniform(0.9, 1.1)  # noqa: S311
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._listed.wait(), period)
            while self._listed.is_set():
                self._listed.clear()
                await asyncio.sleep(SETTLING_SECONDS)
            await self._compared()

    async def _compared(self) -> bool:
        """Return whether the objects could be compared."""
        try:
            await self.compare()
        except (ApiError, OSError) as error:
            LOGGER.warning("the objects cannot be listed: %s", error)
            return False
        finally:
            heap.trim()
        return True

    async def compare(self) -> None:
        """Remove what is gone from the store, add what was missed."""
        missed = [kind.name for kind in self._kinds if await self._compare(kind)]
        self._misses = self._misses + 1 if missed else 0
        if self._misses > 1:  # once may be chance: the list was newer than the stream
            self.dead_watch = f"the watch of {missed[0]} is dead"

    async def _compare(self, kind: WatchedKind) -> bool:
        """Compare one kind; return whether the watch of the kind has missed a change."""
        before = dict(kind.stored())
        there: set[Id] = set()
        new = False
        # Not from the server's cache: what is missing in the answer counts as deleted.
        for space in self._settings.namespaces or (None,):
            async for obj in self._api.list(kind.path(space), **kind.selection):
                id_ = id_of(obj)
                there.add(id_)
                if before.get(id_) != metadata(obj).get("resourceVersion"):
                    missed = id_ not in before and not kind.has(id_)  # we may just have made it
                    new = (self._learn(kind, obj) and missed) or new
        gone = [id_ for id_ in before if id_ not in there]
        for id_ in gone:
            kind.forget(id_)
        if gone:
            LOGGER.info("%d %s were deleted without an event of a watch", len(gone), kind.name)
        return new

    def _learn(self, kind: WatchedKind, obj: Object) -> bool:
        """Load an object; return whether loading worked: one bad object must not affect others."""
        try:
            kind.learn(obj)
        except Exception:
            LOGGER.exception("%s: %s/%s cannot be taken", kind.name, *id_of(obj)[:2])
            return False
        return True
