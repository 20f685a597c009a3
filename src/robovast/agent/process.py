"""`process`: postprocesses a campaign in the cluster, like `vast results postprocess`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from robovast.agent.bucket import Bucket
from robovast.agent.campaign import read_plan
from robovast.agent.mounts import Folders
from robovast.agent.untrusted_files import SIDE_BY_SIDE
from robovast.analysis.postprocessing import state
from robovast.analysis.postprocessing.content import changed, scan
from robovast.analysis.postprocessing.events import Failure, Options, PostprocessingSummary
from robovast.analysis.postprocessing.session import postprocess
from robovast.base.errors import ExitCode, InputError, StorageError
from robovast.campaign.layout import RUN_RECORD
from robovast.campaign.object_keys import Keys, run_of
from robovast.campaign.run_files import StoredFile, Writer, escaped, is_writers
from robovast.campaign.run_record import RunRecord, read_run_record
from robovast.kubeapi.pod_contract.exit_codes import AgentExit
from robovast.kubeapi.pod_contract.messages import Processed
from robovast.kubeapi.pod_contract.storage_address import passed_address
from robovast.storage.bucket_ownership import is_owned
from robovast.storage.bucket_runs import listed_files
from robovast.storage.download import Silent, download_campaign
from robovast.storage.endpoint import Credentials
from robovast.storage.s3 import ObjectStore

CACHE = f"{state.FOLDER}/{state.FILE}"
"""File with the finished steps of postprocessing."""
MOST_LISTED = 5
"""Most failures that the termination message lists."""


def process(folders: Folders) -> AgentExit:
    """Do the document's results processing; the bucket then has what a download at home would make.

    Only what changed since an earlier execution is worked again. When the pod is told to end, what
    is not stored yet is left to the next one.

    Raises:
        PlanError: there is no plan, or none of this version.
        InputError: a command failed; what the others made is stored.
        StorageError: the bucket, or the pod's disk, cannot be read or written.
    """
    plan = read_plan(folders.campaign_plan)
    credentials = Credentials.from_folder(folders.credentials)
    store = ObjectStore(passed_address(), credentials, connections=SIDE_BY_SIDE)
    campaign = folders.work / "results" / plan.campaign
    bucket = Bucket(store, plan.bucket, plan.owner)
    is_owned(store, plan.bucket, plan.owner.uid)
    there = [item.key for item in store.objects(plan.bucket)]
    brought = download_campaign(store, plan.bucket, campaign, Silent())
    for warning in brought.warnings:
        print(warning)  # noqa: T201
    before = scan(campaign, ())
    (summary,) = postprocess(campaign, Options(), _Log())
    if summary.interrupted:
        return AgentExit.RUNS_LEFT
    new = changed(before, scan(campaign, ()))
    stored = _store_changes(bucket, campaign, new, there)
    _refuse_failures(summary.failures)
    worked = len(summary.worked)
    Processed(runs=summary.runs, worked=worked, stored=stored).write(folders.message)
    return AgentExit.PASSED


def _store_changes(bucket: Bucket, campaign: Path, new: Iterable[str], there: Iterable[str]) -> int:
    """Store new and changed files; return how many.

    The cache comes last, so that what it claims is in the bucket.
    """
    grouped: dict[str, list[str]] = {}
    for path in new:
        if not path.startswith(f"{state.FOLDER}/") and not (campaign / path).is_symlink():
            grouped.setdefault(run_of(path), []).append(path)
    known = Keys(there)

    def store(path: str) -> int:
        with (campaign / path).open("rb") as file:
            return bucket.put(escaped(path), file, known)

    def add(run: str) -> int:
        return add_to_run(bucket, campaign, run, grouped[run])

    with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        stored = sum(pool.map(store, grouped.pop("", [])))
        stored += sum(pool.map(add, grouped))
    if stored or CACHE not in known:
        bucket.store.put_file(bucket.name, CACHE, campaign / CACHE)
    return stored


def add_to_run(bucket: Bucket, campaign: Path, run: str, paths: Iterable[str]) -> int:
    """Store new files of a run beside the others; none if the run was repeated meanwhile.

    Its record is replaced, so that a later download fetches it again.
    """
    record, etag = bucket.seen(run)
    if record is None or record != read_run_record(campaign / run):
        return 0
    writer = Writer(run)
    files = {file.path: file for file in _files_of(bucket, run, record)}
    added = 0
    for added, path in enumerate(paths, 1):
        below = path[len(run) + 1 :]
        key = writer.key(below, added)
        with (campaign / path).open("rb") as file:
            sent = bucket.store.put_new(bucket.name, f"{run}/{key}", file)
        files[below] = StoredFile(below, key, sent.size, sent.sha256)
    listed = bucket.store_list(writer, list(files.values()))
    return added if bucket.settle(run, replace(record, files=listed), etag) else 0


def _files_of(bucket: Bucket, run: str, record: RunRecord) -> Iterator[StoredFile]:
    """The files of a run; if its record names none, they are beside it."""
    if record.files is not None:
        yield from listed_files(bucket.store, bucket.name, run, record.files)
        return
    for item in bucket.store.objects(bucket.name, f"{run}/"):
        key = item.key[len(run) + 1 :]
        if key != RUN_RECORD and not is_writers(key):
            digest = bucket.store.digest(bucket.name, item.key) or ""
            yield StoredFile(key, key, item.size, digest)


def _refuse_failures(failures: Iterable[Failure]) -> None:
    """Raise one error for all failures.

    Raises:
        StorageError: the cause is the pod's disk.
        InputError: the cause is the document, or a command.
    """
    listed = list(failures)
    if any(failure.code is ExitCode.STORAGE for failure in listed):
        raise StorageError(describe(listed))
    if listed:
        raise InputError(describe(listed))


def describe(failures: Iterable[Failure]) -> str:
    """Describe what failed, where and why; each reason is named once."""
    reasons: dict[str, list[Failure]] = {}
    for failure in failures:
        reasons.setdefault(failure.message, []).append(failure)
    sentences = [_sentence(reason, alike) for reason, alike in reasons.items()]
    more = (
        [f"… and {len(sentences) - MOST_LISTED} more reasons."]
        if len(sentences) > MOST_LISTED
        else []
    )
    return "\n".join(
        [
            ("some postprocessing failed; the results of the other commands are stored."),
            *sentences[:MOST_LISTED],
            *more,
        ]
    )


def _sentence(reason: str, alike: Iterable[Failure]) -> str:
    listed = list(alike)
    commands = ", ".join(sorted({failure.command for failure in listed}))
    runs = sorted({failure.where for failure in listed} - {""})
    more = f" and {len(runs) - 1} more" if len(runs) > 1 else ""
    where = f" ({runs[0]}{more})" if runs else ""
    return f"{commands}{where}: {reason}"


class _Log:
    """Writes the progress to the pod's log; failures of one reason are written once."""

    def __init__(self) -> None:
        self._reasons: set[str] = set()

    def campaign_started(self, campaign: Path, runs: int) -> None:
        """Say what is looked at."""
        print(f"{campaign.name}: {runs} runs")  # noqa: T201

    def step_started(self, title: str, total: int) -> None:
        """Say what begins."""
        print(f"{title} ({total})")  # noqa: T201

    def step_advanced(self) -> None:
        """Say nothing."""

    def failed(self, failure: Failure) -> None:
        """Say it when its reason is new."""
        if failure.message not in self._reasons:
            self._reasons.add(failure.message)
            print(f"failed: {failure}")  # noqa: T201

    def message(self, text: str) -> None:
        """Pass it on."""
        print(text)  # noqa: T201

    def campaign_finished(self, summary: PostprocessingSummary) -> None:
        """Say how much there was to do."""
        print(f"Postprocessed {len(summary.worked)} runs.")  # noqa: T201
