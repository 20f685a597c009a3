"""All campaigns of a results folder, kept up to date."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock

from robovast.base.errors import InputError
from robovast.base.safe_paths import read_file
from robovast.campaign.object_keys import OMITTED
from robovast.evaluation.campaign_index import CampaignIndex
from robovast.evaluation.campaigns import find_campaigns
from robovast.evaluation.confined_files import MissingError, resolved
from robovast.evaluation.summaries import CampaignSummary
from robovast.model.naming import holds_campaign

BUSY, CALM = 10, 100
"""Minimum time between refreshes, as multiples of a refresh; CALM if nothing is in progress."""


@dataclass
class _Shelf:
    index: CampaignIndex
    summary: CampaignSummary | None = None
    fault: str = ""
    """Why the campaign could not be read at the last refresh."""
    changed: int = -1
    """Modification time of the campaign's folder at the last refresh [ns]."""
    looked: float = 0.0
    """Time of the last refresh on the monotonic clock [s]."""
    cost: float = 0.0
    """Duration of the last refresh [s]."""
    lock: Lock = field(default_factory=Lock)


class Library:
    """Campaigns by name; thread-safe."""

    lasts = True
    """Whether the folder is there when the page has ended."""

    def __init__(self, results: Path) -> None:
        self.results = results.resolve()
        """The results folder, without links."""
        self._shelves: dict[str, _Shelf] = {}

    @property
    def place(self) -> str:
        """Where the campaigns are."""
        return str(self.results)

    def bring(self, path: str) -> None:
        """Make the files of the run that a path below `results` is of available there."""

    def require_all(self, what: str) -> None:
        """Refuse what would need the files of all runs, where they are not here."""

    def names(self) -> list[str]:
        """Names of the current campaigns, the newest first.

        Raises:
            InputError: the folder cannot be read.
        """
        found = find_campaigns(self.results)
        for name in set(self._shelves) - set(found):
            self._shelves.pop(name, None)
        return found

    def known(self, name: str) -> tuple[CampaignSummary | None, str]:
        """The last summary of a campaign, and why it could not be read; does not read files.

        Raises:
            InputError: there is no such campaign.
        """
        shelf = self._shelf(name)
        return shelf.summary, shelf.fault

    def summary(self, name: str) -> CampaignSummary:
        """Summary of a campaign, refreshed if it may have changed.

        Raises:
            InputError: there is no such campaign, or it cannot be read.
        """
        return self._read(self._shelf(name))

    def campaign(self, name: str) -> CampaignIndex:
        """The current state of a campaign.

        Raises:
            InputError: there is no such campaign, or it cannot be read.
        """
        shelf = self._shelf(name)
        self._read(shelf)
        return shelf.index

    def begun(self, name: str) -> CampaignIndex | None:
        """A campaign some of whose variants are read, while they are read for the first time.

        Does not wait until all are.

        Raises:
            InputError: there is no such campaign.
        """
        index = self._shelf(name).index
        return index if index.reading and not index.version else None

    def reading(self) -> dict[str, tuple[int, int]]:
        """Campaigns that are being read: how many of their variants are, and of how many."""
        shelves = list(self._shelves.items())
        return {name: done for name, shelf in shelves if (done := shelf.index.reading)}

    def _shelf(self, name: str) -> _Shelf:
        known = self._shelves.get(name)
        if known is None:
            path = resolved(self.results, name)
            if path.parent != self.results or path.name != name or not holds_campaign(path):
                raise MissingError(f"There is no campaign {name}.")
            known = self._shelves.setdefault(name, _Shelf(self._index(name)))
        return known

    def _index(self, name: str) -> CampaignIndex:
        return CampaignIndex(self.results, name)

    def _read(self, shelf: _Shelf) -> CampaignSummary:
        with shelf.lock:
            try:
                self._refuse_omitted(shelf.index.name)
                if self._may_have_changed(shelf) and _refresh(shelf):
                    shelf.summary = None
            except InputError as error:
                shelf.fault = str(error)
                raise
            shelf.fault = ""
            if shelf.summary is None or shelf.index.active is not None:
                shelf.summary = shelf.index.summary()
            return shelf.summary

    def _refuse_omitted(self, name: str) -> None:
        """Refuse a campaign that a mirror has no room for; the reason is in its folder."""
        with suppress(OSError):
            path = resolved(self.results, name) / OMITTED
            raise InputError(read_file(path).decode("utf-8", "replace"))

    def _may_have_changed(self, shelf: _Shelf) -> bool:
        changed = resolved(self.results, shelf.index.name).stat().st_mtime_ns
        pause = shelf.cost * (CALM if shelf.index.active is None else BUSY)
        if time.monotonic() - shelf.looked < pause and changed == shelf.changed:
            return False
        shelf.changed = changed
        return True


def _refresh(shelf: _Shelf) -> bool:
    begin = time.monotonic()
    changed = shelf.index.refresh()
    shelf.looked = time.monotonic()
    shelf.cost = shelf.looked - begin
    return changed
