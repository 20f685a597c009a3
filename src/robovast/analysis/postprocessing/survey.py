"""Finds changes in a campaign since its last postprocessing."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from robovast.analysis.postprocessing.content import (
    Files,
    changed,
    combined,
    digests,
    scan,
    signature,
    stamp_of,
)
from robovast.analysis.postprocessing.state import Unit
from robovast.campaign.layout import JOB_LINK, POSTPROCESSING, Layout, job_folder
from robovast.model.document.commands import JOB_LOGS
from robovast.model.naming import CAMPAIGN_STORE, CONFIG, GRAPH, METADATA, TRANSIENT

OWN = "."
"""The unit of the campaign's own files, apart from its runs."""
WHOLE = ""
"""The unit of the whole campaign; its inputs are those of all other units."""

_GENERATED = (METADATA, GRAPH, "metadata.dot", "metadata.pdf", CAMPAIGN_STORE)
"""Files of a campaign's folder that are made of all others."""
_OWN_FOLDERS = (CONFIG, TRANSIENT)
_MADE_OF_LOGS = re.compile(r"logs/[^/]*\.(csv|webm|part)$")
_RECORDINGS = ("rosbag2", f"{JOB_LINK}/{JOB_LOGS}")


class Survey:
    """The files of one campaign by unit."""

    def __init__(self, campaign: Path, document: Path | None) -> None:
        self.campaign = campaign
        self.document = document
        self._job_stamps = lru_cache(maxsize=None)(_job_stamps)
        self._variant_stamp = lru_cache(maxsize=None)(stamp_of)
        self._tree_digest = lru_cache(maxsize=None)(_tree_digest)
        self._job_digest = lru_cache(maxsize=None)(_job_digest)

    def runs(self) -> list[str]:
        """All stored runs as `<variant>/<number>`."""
        return [
            f"{folder.parent.name}/{folder.name}" for folder in Layout(self.campaign).run_folders()
        ]

    def has_recording(self, runs: Iterable[str]) -> bool:
        """Whether any run has a bag, or its job a recording of logs."""
        return any(
            os.path.isdir(f"{self.campaign}/{run}/{below}") for run in runs for below in _RECORDINGS
        )

    def folder(self, unit: str) -> Path:
        """The folder of a unit."""
        return self.campaign / unit

    def files(self, unit: str) -> Files:
        """The current files of a unit."""
        return self._own_files() if unit == OWN else scan(f"{self.campaign}/{unit}")

    def signature(self, unit: str, files: Files) -> str:
        """A digest; if it is equal, nothing changed, otherwise the content must be compared."""
        return signature(files, () if unit == OWN else self._beside(unit))

    def look(self, unit: str, known: Unit | None) -> Unit:
        """The current state of a unit, with its stored claims if the content is the same.

        Args:
            unit: the unit's path.
            known: the stored state.
        """
        files = self.files(unit)
        sign = self.signature(unit, files)
        if known is not None and known.signature == sign:
            return known
        known = known or Unit(unit)
        made = digests(self.folder(unit), set(files) & set(known.made))
        inputs = self.inputs(unit, set(files) - set(made))
        if inputs == known.inputs and made == known.made:
            return replace(known, signature=sign)
        return Unit(unit, sign, inputs, made)

    def look_at_all(self, units: Iterable[str], known: Mapping[str, Unit]) -> dict[str, Unit]:
        """The current state of all units, by path."""
        names = list(units)
        quick = {name: known.get(name) for name in names}
        moved = [name for name, unit in quick.items() if not self._same(name, unit)]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            looked = pool.map(lambda name: self.look(name, quick[name]), moved)
            found = dict(zip(moved, looked, strict=True))
        return {name: found.get(name) or known[name] for name in names}

    def worked(self, unit: Unit, before: Files, after: Files) -> Unit:
        """A unit's state after a command worked on it.

        Args:
            unit: the previous state.
            before: the previous files.
            after: the current files.
        """
        new = set(changed(before, after))
        made = {name: digest for name, digest in unit.made.items() if name in after}
        made.update(digests(self.folder(unit.path), new))
        raw = [name for name in before if name not in unit.made]
        touched = any(after.get(name) != before[name] for name in raw)
        inputs = self.inputs(unit.path, set(after) - set(made)) if touched else unit.inputs
        return replace(unit, signature=self.signature(unit.path, after), inputs=inputs, made=made)

    def inputs(self, unit: str, names: Iterable[str]) -> str:
        """A digest of the content that a unit's commands read, without generated files."""
        parts = digests(self.folder(unit), names)
        if unit != OWN:
            folder = self.folder(unit)
            job = job_folder(folder)
            parts["/config"] = self._tree_digest(folder.parent / CONFIG)
            parts["/job"] = self._job_digest(job) if job else combined({})
        return combined(parts)

    def _same(self, unit: str, known: Unit | None) -> bool:
        return known is not None and self.signature(unit, self.files(unit)) == known.signature

    def _beside(self, run: str) -> list[int]:
        variant = run.rpartition("/")[0]
        job = job_folder(self.campaign / run)
        stamps = self._job_stamps(str(job)) if job else []
        return [self._variant_stamp(f"{self.campaign}/{variant}/{CONFIG}"), *stamps]

    def _own_files(self) -> Files:
        found: Files = {}
        for entry in os.scandir(self.campaign):
            if os.path.isfile(entry.path) and not entry.name.startswith((".", *_GENERATED)):
                status = entry.stat()
                found[entry.name] = (status.st_size, status.st_mtime_ns, status.st_ctime_ns)
        for name in _OWN_FOLDERS:
            ignored = [POSTPROCESSING, *([self.document.name] if self.document else [])]
            files = scan(self.campaign / name, ignored)
            found.update((f"{name}/{path}", stamp) for path, stamp in files.items())
        return found


def _job_stamps(folder: str) -> list[int]:
    """Modification times of a job's folders; its files never change afterwards."""
    return [stamp_of(f"{folder}{below}") for below in ("", "/logs", "/logs/rosout_bag")]


def _job_digest(folder: Path) -> str:
    """Digest of a job's files, without tables made from its recordings."""
    names = (name for name in scan(folder) if not _MADE_OF_LOGS.match(name))
    return combined(digests(folder, names))


def _tree_digest(folder: Path) -> str:
    return combined(digests(folder, scan(folder)))
