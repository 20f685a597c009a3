"""`process`: work a campaign's results up, as `vast results postprocess` does at home."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from robovast.agent.bucket import Bucket
from robovast.agent.campaign import read_plan
from robovast.agent.exit_codes import AgentExit
from robovast.agent.folders import Folders
from robovast.agent.messages import write_message
from robovast.agent.trees import SIDE_BY_SIDE, store_tree
from robovast.cluster.endpoint import Credentials, Endpoint
from robovast.cluster.storage import ObjectStore, StoredObject
from robovast.errors import ExitCode, InputError, StorageError
from robovast.postprocessing import state
from robovast.postprocessing.events import CampaignSummary, Failure, Options
from robovast.postprocessing.records import run_of
from robovast.postprocessing.session import postprocess
from robovast.results.download import Silent, download_campaign
from robovast.results.layout import RUN_RECORD

CACHE = f"{state.FOLDER}/{state.FILE}"
"""What postprocessing has finished."""
MOST_TOLD = 5
"""Different failures that the termination message tells."""
_SAME_TIME = 1e-3
"""Times of a file and of its object differ by less, rounded as they are [s]."""


def process(folders: Folders) -> AgentExit:
    """Do the document's results processing; the bucket then has what a download at home would make.

    Only what changed since an earlier execution is worked again. When the pod is told to end, what
    is not stored yet is left to the next one. The termination message is
    `{"runs": …, "worked": …, "stored": …}`: runs, those of them that something was done for, and
    files that are new in the bucket.

    Raises:
        PlanError: there is no plan, or none of this version.
        InputError: a command failed; what the others made is stored.
        StorageError: the bucket, or the pod's disk, cannot be read or written.
    """
    plan = read_plan(folders.plan / "campaign.json")
    credentials = Credentials.from_folder(folders.credentials)
    endpoint = Endpoint.parse(plan.endpoint, plan.region)
    store = ObjectStore(endpoint, credentials, connections=SIDE_BY_SIDE)
    campaign = folders.work / "results" / plan.campaign
    bucket = Bucket(store, plan.bucket, plan.owner)
    bucket.claim()
    there = {item.key: item for item in store.objects(plan.bucket)}
    download_campaign(store, plan.bucket, campaign, Silent())
    (summary,) = postprocess(campaign, Options(), _Log())
    if summary.interrupted:
        return AgentExit.RUNS_LEFT
    stored = _store_changes(bucket, campaign, there)
    _refuse_failures(summary.failures)
    worked = {"runs": summary.runs, "worked": len(summary.worked), "stored": stored}
    write_message(folders.message, worked)
    return AgentExit.PASSED


def _store_changes(bucket: Bucket, campaign: Path, there: Mapping[str, StoredObject]) -> int:
    """Store the files that are not as they were fetched; returns how many.

    The cache comes last: what it claims is in the bucket then.
    """
    as_fetched = {key for key, item in there.items() if _is_as_fetched(campaign / key, item)}
    own = {f"{state.FOLDER}/{path.name}" for path in (campaign / state.FOLDER).iterdir()}
    stored = store_tree(bucket, campaign, "", there=there, skipped=as_fetched | own)
    _renew_records(bucket, campaign, {run_of(key) for key in stored} - {""})
    if stored or CACHE not in there:
        bucket.store.put_file(bucket.name, CACHE, campaign / CACHE)
    return len(stored)


def _is_as_fetched(path: Path, item: StoredObject) -> bool:
    try:
        found = path.stat()
    except OSError:
        return False
    return found.st_size == item.size and abs(found.st_mtime - item.modified) < _SAME_TIME


def _renew_records(bucket: Bucket, campaign: Path, runs: Iterable[str]) -> None:
    """Store records of runs again, as they are: who has a run fetches it again when it is newer."""

    def renew(run: str) -> None:
        key = f"{run}/{RUN_RECORD}"
        with (campaign / key).open("rb") as file:
            bucket.store.put(bucket.name, key, file, is_new=True)

    with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        list(pool.map(renew, runs))


def _refuse_failures(failures: Iterable[Failure]) -> None:
    """Raise one error for all failures.

    Raises:
        StorageError: the pod's disk is at fault.
        InputError: the document is, or a command.
    """
    listed = list(failures)
    if any(failure.code is ExitCode.STORAGE for failure in listed):
        raise StorageError(describe(listed))
    if listed:
        raise InputError(describe(listed))


def describe(failures: Iterable[Failure]) -> str:
    """What failed where and why; what failed for one reason is told once."""
    reasons: dict[str, list[Failure]] = {}
    for failure in failures:
        reasons.setdefault(failure.message, []).append(failure)
    told = [_sentence(reason, alike) for reason, alike in reasons.items()]
    more = [f"… and {len(told) - MOST_TOLD} more reasons."] if len(told) > MOST_TOLD else []
    return "\n".join(
        ["results processing failed in part; what succeeded is stored.", *told[:MOST_TOLD], *more]
    )


def _sentence(reason: str, alike: Iterable[Failure]) -> str:
    listed = list(alike)
    commands = ", ".join(sorted({failure.command for failure in listed}))
    runs = sorted({failure.where for failure in listed} - {""})
    more = f" and {len(runs) - 1} more" if len(runs) > 1 else ""
    where = f" ({runs[0]}{more})" if runs else ""
    return f"{commands}{where}: {reason}"


class _Log:
    """Tells the pod's log what happens; what goes wrong for one reason, once."""

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

    def campaign_finished(self, summary: CampaignSummary) -> None:
        """Say how much there was to do."""
        print(f"{len(summary.worked)} runs worked on")  # noqa: T201
