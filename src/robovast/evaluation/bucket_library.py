"""A campaign that stays in its bucket: runs of its tables, and files of those that are opened."""

from __future__ import annotations

import os
import re
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

from robovast.analysis.tables.stored import StoredTables
from robovast.base.atomic import discard
from robovast.base.errors import InputError
from robovast.campaign.layout import CONFIGURATIONS, EXECUTION_RECORD, JOBS, SEARCH
from robovast.campaign.object_keys import run_of
from robovast.campaign.run_record import read_run_record
from robovast.evaluation.campaign_index import CampaignIndex
from robovast.evaluation.campaigns import is_search
from robovast.evaluation.library import Library
from robovast.evaluation.tabled_campaign import read_variants
from robovast.evaluation.untrusted_data import read_yaml
from robovast.model.naming import CONFIG, EXECUTION
from robovast.storage.download import Silent, download_campaign
from robovast.storage.s3 import ObjectStore

MOST = 2 << 30
"""Files of opened runs that are kept [bytes]; those of the last one are, whatever their size."""
_LAST = 4
"""Of one run: all configurations, the folders of its own one, of itself and of its job."""
_JOB = re.compile(rf"{JOBS}/(\w[\w.-]*)/")


@dataclass(frozen=True)
class StoredCampaign:
    """A campaign in a bucket."""

    store: ObjectStore
    bucket: str
    name: str
    """Of its results folder."""
    tables: StoredTables | Path


class BucketLibrary(Library):
    """The campaign of a bucket, and of its files those that were asked for; thread-safe."""

    lasts = False

    def __init__(self, campaign: StoredCampaign, folder: Path, most: int = MOST) -> None:
        """Fetch the campaign's inputs.

        Args:
            campaign: where it is.
            folder: folder for what is fetched; created.
            most: how much of the files of runs is kept [bytes].

        Raises:
            StorageError: the bucket cannot be read, or the folder cannot be written.
        """
        folder.mkdir(parents=True)
        super().__init__(folder)
        self._stored = campaign
        self._folder = self.results / campaign.name
        self._most = most
        self._kept: OrderedDict[str, int] = OrderedDict()
        """Sizes of the fetched folders [bytes], the one that was asked for last at the end."""
        self._lock = Lock()
        self._fetch(f"{CONFIG}/", EXECUTION_RECORD, f"{SEARCH}/")
        (self._folder / EXECUTION).mkdir(exist_ok=True)

    @property
    def place(self) -> str:
        """Where the campaign is."""
        return f"{self._stored.store.endpoint}/{self._stored.bucket}"

    def bring(self, path: str) -> None:
        """Fetch the folders of the run or job that a path is of, unless they are here.

        Raises:
            StorageError: the bucket cannot be read, or the folder cannot be written.
        """
        campaign, _, inner = f"{path}/".partition("/")
        if campaign != self._stored.name:
            return
        run, job = run_of(inner), _JOB.match(inner)
        with self._lock:
            if run:
                self._keep(CONFIGURATIONS)
                self._keep(f"{run.partition('/')[0]}/{CONFIG}/")
                self._keep(f"{run}/")
                record = read_run_record(self._folder / run)
                job = _JOB.match(f"{JOBS}/{record.job}/") if record is not None else None
            if job:
                self._keep(job[0])

    def require_all(self, what: str) -> None:
        """Refuse what would need the files of all runs."""
        raise InputError(
            f"{what} would need the files of all runs, which are in a bucket",
            hint="download them with `vast results download`, and open them with `vast "
            "evaluation gui`",
        )

    def _index(self, name: str) -> CampaignIndex:
        return _TabledIndex(self.results, name, self._stored.tables)

    def _keep(self, prefix: str) -> None:
        """Fetch a folder unless it is here, and remove others that were not asked for lately."""
        if prefix in self._kept:
            self._kept.move_to_end(prefix)
            return
        self._kept[prefix] = self._fetch(prefix)
        while sum(self._kept.values()) > self._most and len(self._kept) > _LAST:
            oldest, _ = self._kept.popitem(last=False)
            if os.path.isdir(self._folder / oldest):
                discard(self._folder / oldest)

    def _fetch(self, *prefixes: str) -> int:
        """Fetch what is below some prefixes; return its size [bytes]."""
        store, bucket = self._stored.store, self._stored.bucket
        return download_campaign(store, bucket, self._folder, Silent(), below=prefixes).size


class _TabledIndex(CampaignIndex):
    """The runs of a campaign that has ended, read once from its tables."""

    def __init__(self, results: Path, name: str, tables: StoredTables | Path) -> None:
        super().__init__(results, name)
        self._tables = tables

    def refresh(self) -> bool:
        """Read the tables, the first time; return whether it was.

        Raises:
            CannotRunError: the extra `query` is not installed.
            StorageError: they cannot be read.
        """
        if self.version:
            return False
        self.variants = read_variants(self._tables)
        self._execution = read_yaml(self.results, f"{self.name}/{EXECUTION_RECORD}")
        self._is_search = is_search(self.results, self.name)
        self.version = 1
        return True
