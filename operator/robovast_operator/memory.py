"""Caches of what was read about a campaign; all of it can be read again.

Each part is changed by one module of `effects` alone.
"""

from __future__ import annotations

import math
import time
from asyncio import Future
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from robovast.kubeapi.pod_contract.messages import Proposed
from robovast.model.packing import PackSample
from robovast.model.packs import CampaignPlan, Entry
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import JobState
from robovast_operator.planning.additions import Additions
from robovast_operator.planning.campaign import Accepted, Rejected, Revision
from robovast_operator.pods.observations import Final, Mishap, Trouble
from robovast_operator.pods.verdicts import Report
from robovast_operator.pods.waiting import Waiting


@dataclass(frozen=True)
class Asked:
    """An expansion of a Campaign in another process."""

    mark: object
    """Identifies the input."""
    source: Object | None
    """The user's ConfigMap with the input files."""
    answer: Future[Accepted | Rejected]


@dataclass
class InputsCache:
    """Cache of `effects.inputs`."""

    accepted: Accepted | Rejected | None = None
    accepted_for: str = ""
    """The input that `accepted` was made from."""
    asked: Asked | None = None
    """The expansion that was asked for, until `accepted` is made from it."""
    revisions: list[Revision] | None = None
    planned: CampaignPlan | None = None
    """An existing plan; all plans name the same place for the results."""
    generation_as_planned: int = 0
    """The Campaign's generation whose document was found to be the planned one."""
    source: Object | None = None
    """The user's ConfigMap with the input files, until it is copied."""
    files_made: bool = False
    additions: Additions | None = None
    """What the Configurations applied by hand add."""
    additions_for: tuple[object, ...] = ()
    """The input that `additions` was made from."""
    expanded: dict[str, Entry | str] = field(default_factory=dict)
    """By content of an added entry: its expansion, or the error."""
    expanding: dict[str, Future[Entry | str]] = field(default_factory=dict)
    """By content of an added entry: the expansion that was asked for."""
    withdrawn: set[str] = field(default_factory=set)
    """Deleted Configurations that had asked for runs, by uid."""

    def forget(self) -> None:
        """Forget everything, because another replica has created a plan."""
        self.accepted = self.revisions = self.planned = None

    def cancel(self) -> None:
        """Cancel all expansions, because the campaign is deleted."""
        if self.asked is not None:
            self.asked.answer.cancel()
        for future in self.expanding.values():
            future.cancel()


@dataclass
class Motion:
    """When a campaign's Jobs last changed."""

    jobs: tuple[object, object] | None = None
    """The Jobs as of then; None before the first reconcile."""
    moved: float = field(default_factory=time.monotonic)
    progressed: float = field(default_factory=time.monotonic)
    """When an index last ended, or a Job was last created or resumed."""

    def notice(self, jobs: Mapping[str, JobState]) -> bool:
        """Note the time of changes since the last call; return whether there are any."""
        ends = tuple((j.name, j.completed, j.failed, j.suspended) for j in jobs.values())
        pods = tuple((job.active, job.ready) for job in jobs.values())
        before, self.jobs = self.jobs, (ends, pods)
        if before is None or before == self.jobs:
            return False
        self.moved = time.monotonic()
        if before[0] != ends:
            self.progressed = self.moved
        return True

    def still_for(self) -> float:
        """Return for how long no Job has changed [s]."""
        return time.monotonic() - self.moved

    def fruitless_for(self) -> float:
        """Return for how long no index has ended [s]."""
        return time.monotonic() - self.progressed

    def expect_stall(self, seconds: float) -> None:
        """Look for the cause of an earlier stall at once."""
        self.moved -= seconds
        self.progressed -= seconds


@dataclass(frozen=True)
class JudgedPods:
    """What the pods of a Job show by our own containers."""

    finished: str = ""
    """End of the Job when they were read."""
    foreign: bool = False
    """Whether they have containers that are not ours."""
    over: int = 0
    """Pods that have not ended although our containers have."""
    at_work: int = 0
    """Pods whose agent runs."""
    reports: Mapping[int, Report] = field(default_factory=dict)
    """Of agents that have stored all runs of their index."""
    done: frozenset[int] = frozenset()
    """Of a task: completion indexes whose container has ended well; -1 without indexes."""


@dataclass
class PodsCache:
    """Cache of `effects.diagnose`."""

    motion: Motion = field(default_factory=Motion)
    reports: dict[str, tuple[str, Mapping[int, Report]]] = field(default_factory=dict)
    """By Job: its failed indexes, and the reports of their pods."""
    judged: dict[str, JudgedPods] = field(default_factory=dict)
    """Of `effects.own_pods`, by uid of a Job."""
    judged_at: float = -math.inf
    """When it last read pods that have not ended."""
    foreign: bool = False
    """Whether it found containers that are not ours in pods that have not ended."""
    mishaps: dict[str, Sequence[Mishap]] = field(default_factory=dict)
    """By Job: the first of its pods."""
    finals: dict[str, Final] = field(default_factory=dict)
    proposals: dict[str, Proposed] = field(default_factory=dict)
    samples: dict[str, tuple[int, list[PackSample]]] = field(default_factory=dict)
    """By Job: how many indexes had ended when its pods were read, and the times of these pods."""
    given_up: dict[str, Trouble] = field(default_factory=dict)
    """By uid of a Job that failed as a whole: the cause."""
    stuck: set[str] = field(default_factory=set)
    """Jobs that hold back the deletion of their pods, or whose pods are never created."""
    trouble: Trouble | None = None
    """What is in the way now, until pods are running."""
    deadly: Trouble | None = None
    """What pods have failed of, until something succeeds."""
    successes: Mapping[str, int] = field(default_factory=dict)
    """By uid of a Job: how many indexes are complete, and how many reports have a verdict."""
    diagnosed: float = -math.inf
    """When a stall was last diagnosed."""
    looked: float = 0.0
    """When pods were last read."""


@dataclass
class QueueCache:
    """Cache of `effects.queues`."""

    waiting: Waiting | None = None
    parked: set[str] = field(default_factory=set)
    """Jobs that were removed from their queue because the campaign is suspended."""
    job: tuple[object, ...] = ()
    """The waiting Job, as it was when Kueue was first asked about it."""
    since: float = 0.0
    """When that was."""
    looked: float = 0.0
    """When Kueue was last asked."""


@dataclass
class Memory:
    """The caches of one Campaign."""

    uid: str
    inputs: InputsCache = field(default_factory=InputsCache)
    pods: PodsCache = field(default_factory=PodsCache)
    queue: QueueCache = field(default_factory=QueueCache)
    taken: set[str] = field(default_factory=set)
    """Of `effects.job_maker`: names of the campaign's Jobs that others have taken."""
    witnessed: set[str] = field(default_factory=set)
    """Of `effects.pod_facts`: uids of ended Jobs whose pods were read."""
    delivered: set[str] = field(default_factory=set)
    """Of `effects.deliveries`: uids of ended Jobs that were reported."""
    failing: float | None = None
    """Of the reconcile loop: since when reconciles fail; None if the last one succeeded."""
