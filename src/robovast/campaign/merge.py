"""Merges campaigns: runs of equal configurations are collected and numbered anew.

Configurations are equal if their `config_identifier` is; in parts of one campaign, if their name
is, since a document may have several that differ in nothing else. Jobs keep their names, in a
subfolder named after their campaign: `_jobs/<campaign>/job-N`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from robovast.base import safe_paths
from robovast.base.atomic import appearing_folder
from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml, fingerprint
from robovast.base.yaml_files import read_mapping
from robovast.campaign.configurations import read_configurations
from robovast.campaign.imported import is_imported, mark_imported
from robovast.campaign.layout import (
    JOB_LINK,
    JOB_LINKS,
    JOBS,
    RUN_RECORD,
    VARIANT_RECORD,
    Layout,
    is_variant,
    job_link_target,
)
from robovast.campaign.planned_runs import (
    ADDED,
    MORE_RUNS,
    RUNS,
    PlannedRuns,
    is_fixed,
    planned_runs,
)
from robovast.campaign.run_record import copy_run_record, read_run_record
from robovast.campaign.verdict import read_test_result

MERGED_FROM = "merged_from"
"""Key in a merged campaign's `execution.yaml`: the names of the original campaigns."""


@dataclass(frozen=True)
class MergeResult:
    """The result of a merge."""

    target: Path
    configurations: int
    runs: int
    left_out: tuple[str, ...]
    """`<campaign>/<configuration>/<run>` of runs that were skipped because they are incomplete."""
    unidentified: tuple[str, ...]
    """`<campaign>/<configuration>` of configurations without `config_identifier`; never merged."""


@dataclass(frozen=True)
class _Part:
    """A configuration of one campaign."""

    campaign: Layout
    name: str
    identifier: str | None
    planned: int
    """Runs that its campaign plans; 0 if it says nothing about that."""

    @property
    def path(self) -> str:
        return f"{self.campaign.root.name}/{self.name}"


def merge_campaigns(campaigns: Sequence[Path], target: Path) -> MergeResult:
    """Copy the runs of several campaigns into a new one; the originals do not change.

    Files made from all runs together (metadata, provenance, tables) are not copied and must be
    made again.

    Args:
        campaigns: their folders; `_config` and `_execution` are taken from the last.
        target: folder of the new campaign; it appears when it is complete.

    Raises:
        InputError: there is nothing to merge, two campaigns have one name, or runs would occur
            twice.
        StorageError: the target exists already, or cannot be written.
    """
    _check(campaigns)
    parts = [part for campaign in campaigns for part in _parts(Layout(campaign))]
    merged = _named(_grouped(parts))
    with appearing_folder(target) as folder:
        layout = Layout(folder)
        _copy_folder(Layout(campaigns[-1]).config, layout.config)
        for campaign in map(Layout, campaigns):
            _copy_folder(campaign.jobs, layout.job(campaign.root.name))
        runs = _Runs(layout, target.name)
        for name, group in merged.items():
            first = group[0]
            _copy_folder(first.campaign.variant_config(first.name), layout.variant_config(name))
            runs.copy(name, group)
        if not runs.number:
            raise InputError(
                f"nothing to merge: {_names(campaigns)} contain no completed run",
                hint="select campaigns with results by `--campaign`",
            )
        _write_records(layout, [Layout(path) for path in campaigns], merged, runs)
    unidentified = tuple(p.path for p in parts if p.identifier is None)
    return MergeResult(target, len(merged), runs.number, tuple(runs.left_out), unidentified)


def _check(campaigns: Sequence[Path]) -> None:
    if not campaigns:
        raise InputError(
            "there are no campaigns to merge.", hint="name campaigns with `--campaign`"
        )
    names = [path.name for path in campaigns]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise InputError(f"two of the campaigns are named {twice}", hint="rename the folder of one")
    _check_origins(campaigns)
    _check_runs(campaigns)


def _check_origins(campaigns: Sequence[Path]) -> None:
    """Refuse to merge a merged campaign with one of its originals."""
    found: dict[str, str] = {}
    for path in campaigns:
        for origin in origins(Layout(path)):
            if origin in found:
                raise InputError(
                    f"{found[origin]} and {path.name} both contain the runs of {origin}, which "
                    "would occur twice",
                    hint="select the campaigns to merge with `--campaign`",
                )
            found[origin] = path.name


def _check_runs(campaigns: Sequence[Path]) -> None:
    """Refuse campaigns that contain the same run, such as renamed copies."""
    found: dict[tuple[object, ...], tuple[str, Path]] = {}
    for path in campaigns:
        for run in Layout(path).run_folders():
            mark = _mark(run)
            other, place = found.setdefault(mark, (path.name, run)) if mark else (path.name, run)
            if other != path.name:
                raise InputError(
                    f"{other} and {path.name} both contain the run "
                    f"{place.parent.name}/{place.name}, which would occur twice. One folder can "
                    "be a copy of the other",
                    hint="select the campaigns to merge with `--campaign`",
                )


def _mark(run: Path) -> tuple[object, ...] | None:
    """What identifies an execution anywhere: when, where, of what, how long; None if unknown."""
    record = read_run_record(run)
    if record is None:
        result = read_test_result(run)
        return (result.started_at, result.duration) if result.started_at else None
    known = (record.started_at, record.host, record.duration, fingerprint(record.parameters))
    return known if record.started_at else None


def origins(campaign: Layout) -> list[str]:
    """Names of the original campaigns: of a merged one those in its record, else its own."""
    merged_from = _execution(campaign).get(MERGED_FROM)
    named = merged_from if isinstance(merged_from, list) else []
    return list(map(str, named)) or [campaign.root.name]


def _execution(campaign: Layout) -> dict[str, Any]:
    return read_mapping(campaign.execution_record)


def _parts(layout: Layout) -> Iterator[_Part]:
    plan = planned_runs(_execution(layout))
    for folder in sorted(layout.root.iterdir()):
        if not is_variant(folder.name) or not os.path.isdir(folder):
            continue
        if os.path.isdir(layout.variant_config(folder.name)) or layout.run_folders_of(folder.name):
            known = read_mapping(folder / VARIANT_RECORD).get("config_identifier")
            identifier = str(known) if isinstance(known, str | int) else None
            yield _Part(layout, folder.name, identifier, plan.of(folder.name))


def _grouped(parts: Sequence[_Part]) -> list[list[_Part]]:
    groups: dict[tuple[str, str], list[_Part]] = {}  # no identifier is taken for a path
    for part in parts:
        key = ("identifier", part.identifier) if part.identifier else ("path", part.path)
        groups.setdefault(key, []).append(part)
    return list(groups.values())


def _named(groups: Sequence[list[_Part]]) -> dict[str, list[_Part]]:
    """Groups by the name of their first member; duplicate names get `_2`, `_3`…."""
    reserved = {group[0].name for group in groups}
    named: dict[str, list[_Part]] = {}
    for group in groups:
        name = group[0].name
        if name in named:
            others = (f"{name}_{number}" for number in count(2))
            name = next(other for other in others if other not in named and other not in reserved)
        named[name] = group
    return named


class _Runs:
    """Copies runs and records their origins."""

    def __init__(self, layout: Layout, campaign: str) -> None:
        self.number = 0
        self.planned: dict[str, int] = {}
        """Runs that are planned of each configuration, or exist where none are planned."""
        self.left_out: list[str] = []
        self.jobs: dict[str, str] = {}
        """Job of each run, by `<configuration>/<run>`."""
        self._layout = layout
        self._campaign = campaign
        self._foreign: dict[Layout, bool] = {}

    def copy(self, name: str, group: Sequence[_Part]) -> None:
        """Copy all runs of a group of equal configurations."""
        number = planned = 0
        for part in group:
            planned, before = planned + part.planned, number
            for source in part.campaign.run_folders_of(part.name):
                record = read_run_record(source)
                if not (record.finished if record else self._is_foreign(part.campaign)):
                    self.left_out.append(f"{part.path}/{source.name}")
                    continue
                target = self._layout.run(f"{name}/{number}")
                _copy(source, target)
                safe_paths.remove(target / RUN_RECORD, target)  # a new record replaces it
                job = self._link_job(target, part.campaign.root.name)
                if record is not None:
                    copy_run_record(
                        source,
                        target,
                        campaign=self._campaign,
                        variant=name,
                        run=number,
                        id=self.number,
                        job=job or record.job,
                    )
                number += 1
                self.number += 1
            planned += max(0, number - before - part.planned)
        self.planned[name] = planned

    def _is_foreign(self, campaign: Layout) -> bool:
        """Whether the campaign's tool writes no records, so that missing ones mean nothing."""
        if campaign not in self._foreign:
            records = (os.path.lexists(run / RUN_RECORD) for run in campaign.run_folders())
            self._foreign[campaign] = not any(records)
        return self._foreign[campaign]

    def _link_job(self, run: Path, campaign: str) -> str | None:
        """Adjust a copied run's link to its job's new place; return the job's new name."""
        link = run / JOB_LINK
        if not os.path.islink(link):
            return None
        _, found, inside = link.readlink().as_posix().partition(f"{JOBS}/")
        if not found:
            return None
        link.unlink()
        if ".." in inside.split("/"):
            return None
        job = f"{campaign}/{inside}"
        link.symlink_to(job_link_target(job))
        self.jobs[f"{run.parent.name}/{run.name}"] = job
        return job


def _names(campaigns: Sequence[Path]) -> str:
    return ", ".join(path.name for path in campaigns)


def _copy_folder(source: Path, target: Path) -> None:
    """Copy a folder that campaigns of other tools may not have."""
    if os.path.isdir(source):
        _copy(source, target)


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    safe_paths.copy(source, source.parent, target, target.parent)


def _write_records(
    layout: Layout, campaigns: Sequence[Layout], merged: dict[str, list[_Part]], runs: _Runs
) -> None:
    each = min(runs.planned.values())
    more = {name: number for name, number in runs.planned.items() if number > each}
    added = not all(is_fixed(_execution(campaign)) for campaign in campaigns)
    execution = _execution(campaigns[-1])
    for key in (RUNS, MORE_RUNS, ADDED):
        execution.pop(key, None)
    execution |= PlannedRuns(each, more, added).record()
    merged_from = [origin for campaign in campaigns for origin in origins(campaign)]
    layout.execution.mkdir()
    layout.execution_record.write_text(
        dump_yaml({**execution, MERGED_FROM: merged_from}), encoding="utf-8"
    )
    if any(is_imported(campaign.root) for campaign in campaigns):
        mark_imported(layout.root)
    layout.transient.mkdir()
    (layout.root / JOB_LINKS).write_text(dump_yaml(runs.jobs), encoding="utf-8")
    layout.configurations.write_text(
        dump_yaml(_configurations(campaigns, merged)), encoding="utf-8"
    )


def _configurations(campaigns: Sequence[Layout], merged: dict[str, list[_Part]]) -> dict[str, Any]:
    """`configurations.yaml` of the merged campaign."""
    written = (campaign for campaign in campaigns if os.path.exists(campaign.configurations))
    read = {campaign.root: read_configurations(campaign) for campaign in written}
    entries = {
        (root, entry.get("name")): entry
        for root, data in read.items()
        for entry in data.get("configs") or ()
    }
    configs = [
        {**entries.get((group[0].campaign.root, group[0].name), {}), "name": name}
        for name, group in merged.items()
    ]
    return {**read.get(campaigns[-1].root, {}), "configs": configs}
