"""All campaigns of a results folder, kept up to date."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock

from robovast.errors import InputError
from robovast.evaluation.campaign_index import (
    CampaignIndex,
    CampaignSummary,
    find_campaigns,
    is_campaign,
)
from robovast.evaluation.inside import MissingError, resolved

CALM = 100
"""A campaign that nothing executes is looked through after this many times what that takes."""


@dataclass
class _Shelf:
    index: CampaignIndex
    changed: int = -1
    looked: float = 0.0
    """When it was last looked through, on the monotonic clock [s]."""
    cost: float = 0.0
    """How long that took [s]."""
    summary: CampaignSummary | None = None
    lock: Lock = field(default_factory=Lock)


class Library:
    """Campaigns by name; threads may share it."""

    def __init__(self, results: Path) -> None:
        self.results = results.resolve()
        self._shelves: dict[str, _Shelf] = {}

    def names(self) -> list[str]:
        """Names of the campaigns in the folder now, the newest first.

        Raises:
            InputError: the folder cannot be read.
        """
        found = find_campaigns(self.results)
        for name in self._shelves.keys() - set(found):
            self._shelves.pop(name, None)
        return found

    def summary(self, name: str, *, known_only: bool = False) -> CampaignSummary | None:
        """Summary of a campaign, read again when it may have changed.

        Args:
            name: the campaign's folder.
            known_only: read nothing; None when it was never read.

        Raises:
            InputError: there is no such campaign.
        """
        shelf = self._shelf(name)
        if known_only:
            return shelf.summary
        with shelf.lock:
            if self._may_have_changed(shelf) and _refresh(shelf):
                shelf.summary = None
            if shelf.summary is None or shelf.index.running:
                shelf.summary = shelf.index.summary()
            return shelf.summary

    def campaign(self, name: str) -> CampaignIndex:
        """A campaign as it is now.

        Raises:
            InputError: there is no such campaign.
        """
        self.summary(name)
        return self._shelf(name).index

    def _shelf(self, name: str) -> _Shelf:
        known = self._shelves.get(name)
        if known is None:
            path = resolved(self.results, name)
            if path.parent != self.results or path.name != name or not is_campaign(path):
                raise MissingError(f"There is no campaign {name}.")
            known = self._shelves.setdefault(name, _Shelf(CampaignIndex(self.results, name)))
        return known

    def _may_have_changed(self, shelf: _Shelf) -> bool:
        try:
            changed = os.stat(shelf.index.root).st_mtime_ns
        except OSError as error:
            raise InputError(f"{shelf.index.root}: {error.strerror}.") from None
        recent = time.monotonic() - shelf.looked < CALM * shelf.cost
        if recent and changed == shelf.changed and not shelf.index.running:
            return False
        shelf.changed = changed
        return True


def _refresh(shelf: _Shelf) -> bool:
    begin = time.monotonic()
    changed = shelf.index.refresh()
    shelf.looked = time.monotonic()
    shelf.cost = shelf.looked - begin
    return changed
