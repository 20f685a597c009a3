"""State of a campaign, from the status of its Campaign."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from typing import TYPE_CHECKING, Any

from robovast.base.errors import ExitCode, InputError
from robovast.base.printable import printable
from robovast.kubeapi.resources import Scheduling, Storage
from robovast.kubeapi.status import CampaignStatus, SearchStatus, read_status
from robovast.storage.bucket_names import bucket_name, campaign_id

if TYPE_CHECKING:
    from robovast_cli.kube.api import KubernetesClient

EPOCH = datetime.fromtimestamp(0, UTC)

NAMED = 10
"""Maximum number of campaigns that a message names."""
OLD = 600.0
"""Age at which the status of an unfinished campaign is reported as old [s]."""
_PROBLEMS = {"Accepted": "False", "Succeeded": "False", "Stalled": "True"}
"""Types and status of conditions that are problems."""


_QUEUED = ("QuotaReserved", "False")


@dataclass(frozen=True)
class CampaignState:
    """State of a Campaign resource."""

    resource: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Name of the Campaign."""
        return str(self.resource["metadata"]["name"])

    @property
    def uid(self) -> str:
        """Uid of the Campaign."""
        return str(self.resource["metadata"].get("uid", ""))

    @cached_property
    def status(self) -> CampaignStatus:
        """Status; empty before the operator has written it."""
        return read_status(CampaignStatus, self.resource.get("status"))

    @property
    def folder(self) -> str:
        """Name of the results folder."""
        meta, spec = self.resource["metadata"], self.resource["spec"]
        created = _time(meta.get("creationTimestamp")) or EPOCH
        document = (spec.get("vast") or {}).get("metadata")
        return self.status.campaign or campaign_id(document, self.name, created)

    @property
    def bucket(self) -> str:
        """Name of the bucket, which may not exist yet; empty if the Campaign was rejected.

        If the status is lost or old, the name is derived from the Campaign.
        """
        if self.status.bucket or self.rejected:
            return self.status.bucket
        return bucket_name(self.folder, self.storage.prefix or "", self.uid)

    @cached_property
    def storage(self) -> Storage:
        """Location of the results."""
        return Storage.model_validate(self.resource["spec"].get("storage") or {})

    @cached_property
    def scheduling(self) -> Scheduling:
        """Scheduling of the pods."""
        return Scheduling.model_validate(self.resource["spec"].get("scheduling") or {})

    @property
    def attempt(self) -> int:
        """Maximum number of attempts for unsuccessful runs."""
        return int(self.resource["spec"].get("attempt") or 1)

    @property
    def suspended(self) -> bool:
        """Whether the campaign is stopped."""
        return bool(self.resource["spec"].get("suspend"))

    @property
    def running(self) -> bool:
        """Whether the campaign is neither stopped nor ended."""
        return not self.finished and not self.suspended

    @property
    def is_search(self) -> bool:
        """Whether the campaign is a search."""
        return bool(self.resource["spec"]["vast"].get("search"))

    @property
    def is_current(self) -> bool:
        """Whether the status describes the current spec."""
        generation = int(self.resource["metadata"].get("generation", 0))
        return self.status.observed_generation >= generation

    @property
    def finished(self) -> bool:
        """Whether the campaign has ended."""
        return self.is_current and self.status.state in {"Finished", "Failed", "Rejected"}

    @property
    def complete(self) -> bool:
        """Whether all results are stored; the results of a failed campaign are collected first."""
        aborted = self.status.state == "Failed" and not self.rejected
        return self.finished and (self._is("ResultsAvailable", "True") or not aborted)

    @property
    def rejected(self) -> bool:
        """Whether the operator has rejected the Campaign."""
        return self._is("Accepted", "False")

    @property
    def done(self) -> int:
        """Runs with a verdict."""
        return self.status.runs.decided

    @property
    def messages(self) -> list[str]:
        """Problems of the campaign, without duplicates."""
        found = (c for c in self.status.conditions if _PROBLEMS.get(c.type) == c.status)
        queued = (c for c in self.status.conditions if (c.type, c.status) == _QUEUED)
        shown = [*found, *(() if self.finished else queued)]
        texts = [printable(c.message or c.reason) for c in shown]
        if self.is_old(moment := now()):
            minutes = (self.age(moment) or 0) // OLD * OLD / 60
            texts.append(
                f"The status is more than {minutes:.0f} min old. If runs take less time, check "
                "that the operator is running."
            )
        return list(dict.fromkeys(texts))

    def age(self, now: datetime) -> float | None:
        """Return the time since the status was written [s]; None if unknown or not expected."""
        if self.finished or self.suspended or self.status.state == "Queued":
            return None
        meta = self.resource["metadata"]
        writes = [
            str(entry["time"])
            for entry in meta.get("managedFields") or ()
            if entry.get("subresource") == "status" and entry.get("time")
        ]
        written = _time(max(writes, default=meta.get("creationTimestamp")))
        return None if written is None else max(0.0, (now - written).total_seconds())

    def is_old(self, now: datetime) -> bool:
        """Return whether the status is older than usual."""
        age = self.age(now)
        return age is not None and age >= OLD

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of a command that waited for the campaign, as for a local campaign."""
        runs = self.status.runs
        if self.rejected:
            return ExitCode.BAD_INPUT
        if self._is("Succeeded", "False") and not runs.stored:  # no run could start
            return ExitCode.CANNOT_RUN
        if self.status.search is not None:  # a search looks for failed runs
            return ExitCode.OK if self._is("Passed", "True") else ExitCode.RUN_ERRORED
        if runs.failed:
            return ExitCode.TEST_FAILED
        if runs.errored:
            return ExitCode.RUN_ERRORED
        if self.status.state == "Failed":
            return ExitCode.RUN_ERRORED if self.done else ExitCode.CANNOT_RUN
        return ExitCode.OK if self.done >= runs.needed else ExitCode.RUN_ERRORED

    def counts(self) -> str:
        """`12 of 260 done: 11 passed, 1 failed; 40 not needed; 4 running, 2 waiting`."""
        runs = self.status.runs
        numbers = {"passed": runs.passed, "failed": runs.failed, "errored": runs.errored}
        parts = [f"{count} {word}" for word, count in numbers.items() if count]
        text = f"{self.done} of {runs.needed} done" + (f": {', '.join(parts)}" if parts else "")
        parts = [self.not_needed(), ", ".join(self.pods()), self.search_counts()]
        return "; ".join([text, *filter(None, parts)])

    def not_needed(self) -> str:
        """Return `40 not needed`: runs that are skipped because other runs have decided."""
        number = self.status.runs.not_needed
        return f"{number:,} not needed" if number else ""

    def search_counts(self) -> str:
        """`batches 3/50 | failure_rate 0.97/0.9 | best failure_rate 0.97`; empty without search."""
        search = self.status.search
        if search is None:
            return ""
        best = f"best {search.best}" if search.best else ""
        return printable(" | ".join(filter(None, [search.criteria, best])))

    def pods(self) -> list[str]:
        """Return the numbers of pods: `4 running`, `2 waiting`."""
        runs = self.status.runs
        numbers = {"running": runs.active, "waiting": runs.waiting}
        return [f"{n} {word}" for word, n in numbers.items() if n and not self.finished]

    def elapsed(self, now: datetime) -> float | None:
        """Return the time from the first Job to now or to the end [s]; None before."""
        start = _time(self.status.start_time)
        if start is None:
            return None
        end = _time(self.status.completion_time) if self.finished else None
        return max(0.0, ((end or now) - start).total_seconds())

    def left(self, now: datetime) -> float | None:
        """Return the estimated remaining time [s]; None if unknown."""
        elapsed = self.elapsed(now)
        if elapsed is None or self.finished or self.suspended or not self.done:
            return None
        if self.is_old(now) or self.status.search is not None:  # its next batches are unknown
            return None
        return elapsed / self.done * (self.status.runs.needed - self.done)

    def summary(self) -> Iterator[str]:
        """Yield the result in lines: problems, unsuccessful runs, counts."""
        yield from self.messages
        runs, search = self.status.runs, self.status.search
        if search is not None:
            yield from _found(search)
            yield f"{self.counts()}."
            return
        for path in self.status.failing:
            yield f"unsuccessful: {path}"
        more = runs.failed + runs.errored - len(self.status.failing)
        if self.status.failing and more > 0:
            yield f"… and {more} more unsuccessful runs."
        if self.status.decisions:
            yield f"{printable(self.status.decisions)}."
        if runs.total:
            yield f"{self.counts()}."

    def _is(self, kind: str, status: str) -> bool:
        return any(c.type == kind and c.status == status for c in self.status.conditions)


def _found(search: SearchStatus) -> Iterator[str]:
    """Yield the reason why a search stopped, and its best value."""
    if search.stop_reason:
        yield f"The search stopped: {printable(search.stop_reason)}."
    if search.best:
        yield f"Best: {printable(search.best)}"


def campaign_states(kube: KubernetesClient) -> list[CampaignState]:
    """Return all Campaigns of the namespace, the oldest first."""
    return [CampaignState(item) for item in kube.campaigns()]


def lookup(known: Iterable[CampaignState], name: str) -> CampaignState | None:
    """Return the campaign with this name, results folder or bucket, or None.

    Raises:
        InputError: results folders of several have that name.
    """
    found = [c for c in known if name in {c.name, c.folder, c.bucket}]
    exact = [c for c in found if c.name == name] or found
    if len(exact) > 1:
        names = ", ".join(campaign.name for campaign in exact)
        raise InputError(
            f"several campaigns have results named {name}", hint=f"name one of them: {names}"
        )
    return exact[0] if exact else None


def find_campaign(known: Sequence[CampaignState], name: str, namespace: str) -> CampaignState:
    """Return the campaign with this name, results folder or bucket.

    Raises:
        InputError: there is none.
    """
    found = lookup(known, name)
    if found is None:
        raise InputError(
            f"there is no campaign `{name}` in the namespace {namespace}; it has "
            f"{list_names(known)}.",
            hint="name a campaign, or select another namespace with `--namespace`",
        )
    return found


def list_names(known: Sequence[CampaignState]) -> str:
    """Return the names of the newest campaigns for a message."""
    names = [campaign.name for campaign in known[-NAMED:]]
    others = len(known) - len(names)
    more = f"and {others} older ones (`vast exec cluster monitor --once`)"
    return ", ".join([*names, *([more] if others else [])]) or "none"


def _time(text: str | None) -> datetime | None:
    return datetime.fromisoformat(text) if text else None


def now() -> datetime:
    """Return the current time."""
    return datetime.now(UTC)
