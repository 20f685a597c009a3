"""Takes over runs that another campaign of the storage has executed with the same key."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from robovast.agent.bucket import seen_record
from robovast.agent.campaign import PodCampaign
from robovast.agent.pack import KeyParts, Pack, PodStart
from robovast.agent.results import PodResults
from robovast.agent.reusable_runs import find_offer, is_result
from robovast.base import safe_paths
from robovast.base.containers import named_digest
from robovast.base.errors import RefusedError, StorageError
from robovast.base.printable import is_printable, printable
from robovast.campaign.layout import JOBS, OWN_NAMES
from robovast.campaign.object_keys import is_plain
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict, read_test_result
from robovast.execution.run_key import common_key, own_parts
from robovast.model.document import Document
from robovast.model.plan import Run
from robovast.model.scenario import Scenario
from robovast.storage.bucket_runs import BucketFile, RunObjects, open_run
from robovast.storage.s3 import ObjectStore
from robovast.storage.s3_errors import ObjectError

T = TypeVar("T")

_RUN, _JOB = "run", "job"
"""Folders of what is brought."""

_DEPENDS_ON = {"timeout", "run_as_user", "resources", "secondary_containers", "kubernetes"}
"""Keys of `execution` that are neither in the environment nor in the files of runs."""


def key_parts(
    campaign: PodCampaign,
    document: Document,
    scenario: Scenario,
    runs: Sequence[Run],
    environment: Mapping[str, str],
    common: Path,
) -> KeyParts | None:
    """What the keys of runs are made of; None if it is not known what their image contains.

    Args:
        campaign: the campaign.
        document: of the campaign.
        scenario: of the document.
        runs: the runs, with the files of their variants.
        environment: of a job.
        common: folder of the files that all runs share.
    """
    image = named_digest(campaign.plan.image)
    if not image or document.vast.execution.seed is None:
        return None
    settings = {
        "runtime": ["kubernetes", image, platform.machine()],  # a digest may be of several images
        "environment": environment,
        "cluster": campaign.plan.cluster,
        "execution": document.vast.execution.model_dump(mode="json", include=_DEPENDS_ON),
    }
    return KeyParts(common_key(settings, common), own_parts(runs, scenario))


@dataclass(frozen=True)
class _Found:
    """A run of another campaign."""

    bucket: str
    record: RunRecord
    files: tuple[tuple[str, BucketFile], ...]
    """What it wrote, by path in its folder."""


def take_over(campaign: PodCampaign, pack: Pack, job: PodStart) -> dict[int, Verdict]:
    """Store the runs of a job as another campaign has stored them; none if one is not there.

    A process executes the runs of a job one after the other, so that they belong together. They
    are brought one by one, as they were executed: the disk has room for one. From the first that
    is not what it was they are left to the pod.

    Returns:
        Verdicts of those that are stored, by id.

    Raises:
        StorageError: they cannot be stored, or the storage is gone for too long.
    """
    keys, store = pack.keys_of(job), campaign.store
    found: list[_Found] = []
    for run in job.runs:
        one = _if_fit(store, run, "", partial(_find, store, keys[run.id]))
        if one is None:
            return {}
        found.append(one)
    results = PodResults(campaign.bucket, pack, pod="")
    stage = campaign.folders.scratch / "reused"
    verdicts: dict[int, Verdict] = {}
    try:
        for run, one in zip(job.runs, found, strict=True):
            bring = partial(_bring, store, one, stage, with_job=not verdicts)
            if not _if_fit(store, run, one.bucket, bring):
                break
            if not verdicts:
                results.store_job(job, stage / _JOB)
            stored = results.store_copy(job, run, one.record, stage / _RUN)
            verdicts[run.id] = stored.verdict
    finally:
        safe_paths.remove(stage, stage.parent)
    return verdicts


def _if_fit(store: ObjectStore, run: Run, bucket: str, read: Callable[[], T]) -> T | None:
    """What is read of another campaign; None, which is said, if it is not what it was.

    Args:
        store: the storage.
        run: which is to be taken over.
        bucket: of the other campaign, if it is known.
        read: reads.

    Raises:
        StorageError: the storage is gone for too long.
    """
    try:
        return read()
    except (ObjectError, RefusedError, OSError) as error:
        why = str(error)
    except StorageError as error:
        if not bucket or store.has_bucket(bucket):
            raise
        why = str(error)  # the campaign is being removed
    print(printable(f"{run.path} is not reused: {why}"))  # noqa: T201
    return None


def _find(store: ObjectStore, key: str) -> _Found | None:
    """A run with a key; None if there is none.

    Raises:
        ObjectError: it is not what it was.
        StorageError: the storage refuses, or is gone for too long.
    """
    place = find_offer(store, key)
    record = seen_record(store, place.bucket, place.run)[0] if place is not None else None
    if place is None or record is None or record.key != key or not is_result(record):
        return None  # its campaign is gone, or has repeated it
    name = f"{place.bucket}/{place.run}"
    if not is_plain(record.job) or not is_printable(record.job):
        raise ObjectError(f"{name}: its record names no job")
    opened = open_run(store, place.bucket, RunObjects(place.run, (), 0, 0))
    files = {file.path.removeprefix(f"{place.run}/"): file for file in opened.files}
    wanted = []
    for path, sha256 in (record.outputs or {}).items():
        if not is_plain(path) or path.partition("/")[0] in OWN_NAMES:
            raise ObjectError(f"{name}: `{path}` is not a valid path of an output file of a run")
        if path not in files or files[path].item.sha256 != sha256:
            raise ObjectError(f"{name}: `{path}` has changed since the run")
        wanted.append((path, files[path]))
    return _Found(place.bucket, record, tuple(wanted))


def _bring(store: ObjectStore, found: _Found, stage: Path, *, with_job: bool) -> bool:
    """Bring the files of a run into an empty folder, and the output of its job.

    Raises:
        ObjectError: it is not what it was.
        StorageError: the storage refuses, or is gone for too long.
        OSError: this disk cannot have its files.
    """
    folder = stage / _RUN
    folder.mkdir(parents=True)
    for path, file in found.files:
        file.bring(store, found.bucket, folder / path)
    verdict = read_test_result(folder).verdict
    if verdict is not found.record.verdict:
        name = f"{found.bucket}/{found.record.variant}/{found.record.run}"
        raise ObjectError(f"{name}: it is {found.record.verdict}, but {verdict} by its test.xml")
    if with_job:
        _bring_job(store, found, stage / _JOB)
    return True


def _bring_job(store: ObjectStore, found: _Found, folder: Path) -> None:
    """Bring the output of the job that executed a run."""
    prefix = f"{JOBS}/{found.record.job}/"
    folder.mkdir(parents=True)
    for item in store.objects(found.bucket, prefix):
        path = item.key.removeprefix(prefix)
        if is_plain(path):
            store.get_file(found.bucket, item, folder / path)
