"""What need not be found out twice of a campaign; all of it can be found out anew.

Each part belongs to one module of `effects`, which alone changes it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from robovast.model.packs import CampaignPlan, Entry
from robovast_operator.kube.objects import Object
from robovast_operator.kube.store import JobState
from robovast_operator.planning.additions import Additions
from robovast_operator.planning.campaign import Accepted, Rejected, Revision
from robovast_operator.pods.findings import Final, Trouble
from robovast_operator.pods.verdicts import Report
from robovast_operator.pods.waiting import Waiting


@dataclass
class InputsCache:
    """Of `effects.inputs`."""

    accepted: Accepted | Rejected | None = None
    accepted_for: str = ""
    """What `accepted` was made from."""
    revisions: list[Revision] | None = None
    planned: CampaignPlan | None = None
    """A plan that was fixed; all of them agree on where results are."""
    generation_as_planned: int = 0
    """Of the Campaign, whose document was found to be the one that was planned."""
    source: Object | None = None
    """The ConfigMap with the input files, until they are copied."""
    files_made: bool = False
    additions: Additions | None = None
    """What Configurations that were applied by hand add."""
    additions_for: tuple[object, ...] = ()
    """What `additions` was made from."""
    expanded: dict[str, Entry | str] = field(default_factory=dict)
    """By content of an entry that was added, what it expands to, or what is wrong."""
    withdrawn: set[str] = field(default_factory=set)
    """Configurations that asked for runs and are gone, by uid."""

    def forget(self) -> None:
        """Somebody else has fixed a plan: read and check everything anew."""
        self.accepted = self.revisions = self.planned = None


@dataclass
class Motion:
    """When something of a campaign's Jobs last moved."""

    jobs: tuple[object, object] | None = None
    """The Jobs as they were then; None before the first look."""
    moved: float = field(default_factory=time.monotonic)
    progressed: float = field(default_factory=time.monotonic)
    """When something last came to its end, or was begun."""

    def notice(self, jobs: Mapping[str, JobState]) -> tuple[bool, bool]:
        """Whether something has moved, and whether something has come to its end, or was begun."""
        ends = tuple((j.name, j.completed, j.failed, j.suspended) for j in jobs.values())
        pods = tuple((job.active, job.ready) for job in jobs.values())
        before, self.jobs = self.jobs, (ends, pods)
        if before is None or before == self.jobs:
            return False, False
        self.moved = time.monotonic()
        if before[0] != ends:
            self.progressed = self.moved
        return True, before[0] != ends

    def still_for(self) -> float:
        """How long nothing has moved [s]."""
        return time.monotonic() - self.moved

    def fruitless_for(self) -> float:
        """How long nothing has come to its end [s]."""
        return time.monotonic() - self.progressed

    def expect_stall(self, seconds: float) -> None:
        """Look for the cause of a known stall at once."""
        self.moved -= seconds
        self.progressed -= seconds


@dataclass
class PodsCache:
    """Of `effects.diagnose`."""

    motion: Motion = field(default_factory=Motion)
    reports: dict[str, tuple[str, Mapping[int, Report]]] = field(default_factory=dict)
    """By Job: its failed indexes and what their pods said."""
    finals: dict[str, Final] = field(default_factory=dict)
    given_up: dict[str, Trouble] = field(default_factory=dict)
    """By uid of a Job that failed as a whole, why."""
    stuck: set[str] = field(default_factory=set)
    """Jobs that hold pods which are to go."""
    trouble: Trouble | None = None
    diagnosed: float = -math.inf
    """When it was last looked why nothing moves."""
    looked: float = 0.0
    """When pods were last looked at."""


@dataclass
class QueueCache:
    """Of `effects.queues`."""

    waiting: Waiting | None = None
    parked: set[str] = field(default_factory=set)
    """Jobs that are known to be out of their queue because the campaign is suspended."""
    job: tuple[object, ...] = ()
    """The Job that waits, as it was when Kueue was first asked about it."""
    since: float = 0.0
    """When that was."""
    looked: float = 0.0
    """When Kueue was last asked."""


@dataclass
class Memory:
    """Of one Campaign, by its uid."""

    uid: str
    inputs: InputsCache = field(default_factory=InputsCache)
    pods: PodsCache = field(default_factory=PodsCache)
    queue: QueueCache = field(default_factory=QueueCache)
    witnessed: set[str] = field(default_factory=set)
    """Of `effects.witness`: uids of Jobs that have ended, and whose pods were looked at."""
    undelivered: set[str] = field(default_factory=set)
    """Of `effects.notifier`: uids of Jobs whose notices reached nobody, and were told to have."""
    failing: float | None = None
    """Of the reconcile loop: since when looks at it fail; None when the last one did not."""
