"""What the operator remembers of a campaign between two looks; all of it can be found out anew."""

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
class Memory:
    """Of one Campaign, by its uid."""

    uid: str
    accepted_for: str = ""
    """What `accepted` was made from."""
    accepted: Accepted | Rejected | None = None
    revisions: list[Revision] | None = None
    planned: CampaignPlan | None = None
    """A plan that was fixed; all of them agree on where results are."""
    generation_as_planned: int = 0
    """Of the Campaign, whose document was found to be the one that was planned."""
    source: Object | None = None
    """The ConfigMap with the input files, until they are copied."""
    files_made: bool = False
    reports: dict[str, tuple[str, Mapping[int, Report]]] = field(default_factory=dict)
    """By Job: its failed indexes and what their pods said."""
    finals: dict[str, Final] = field(default_factory=dict)
    final_trouble: dict[str, Trouble] = field(default_factory=dict)
    """By uid of a Job that failed as a whole."""
    stuck: set[str] = field(default_factory=set)
    """Jobs that hold pods which are to go."""
    trouble: Trouble | None = None
    waiting: Waiting | None = None
    parked: set[str] = field(default_factory=set)
    """Jobs that are known to be out of their queue because the campaign is suspended."""
    queue_job: tuple[object, ...] = ()
    """The Job that waits, as it was when Kueue was first asked about it."""
    queued: float = 0.0
    """When that was."""
    queue_looked: float = 0.0
    """When Kueue was last asked."""
    additions: Additions | None = None
    """What Configurations that were applied by hand add."""
    additions_for: tuple[object, ...] = ()
    """What `additions` was made from."""
    expanded: dict[str, Entry | str] = field(default_factory=dict)
    """By content of an entry that was added, what it expands to, or what is wrong."""
    withdrawn: set[str] = field(default_factory=set)
    """Configurations that asked for runs and are gone, by uid."""
    problems: dict[str, str] = field(default_factory=dict)
    """By Configuration, why its runs cannot be added."""
    picture: tuple[object, object] | None = None
    """The Jobs as they were when something last moved; None before the first look."""
    moved: float = field(default_factory=time.monotonic)
    progressed: float = field(default_factory=time.monotonic)
    """When something last came to its end, or was begun."""
    diagnosed: float = -math.inf
    """When it was last looked why nothing does."""
    looked: float = 0.0
    """When pods were last looked at."""
    status_written: float = 0.0
    failing: float | None = None
    """Since when looks at it fail; None when the last one did not."""
    witnessed: set[str] = field(default_factory=set)
    """Uids of Jobs that have ended, and whose pods were looked at."""
    undelivered: set[str] = field(default_factory=set)
    """Uids of the Jobs whose notices reached nobody, and were told to have."""

    def notice(self, jobs: Mapping[str, JobState]) -> None:
        """Remember when something last moved."""
        ends = tuple((j.name, j.completed, j.failed, j.suspended) for j in jobs.values())
        pods = tuple((job.active, job.ready) for job in jobs.values())
        before, self.picture = self.picture, (ends, pods)
        if before is None or before == self.picture:
            return
        self.moved = time.monotonic()
        self.stuck.clear()
        at_work = any(job.ready for job in jobs.values() if job.open)
        if before[0] != ends or (at_work and not (self.trouble and self.trouble.repeated)):
            self.trouble = None
        if before[0] != ends:
            self.progressed = self.moved

    def forget_inputs(self) -> None:
        """Somebody else has fixed a plan: read and check everything anew."""
        self.accepted = self.revisions = self.planned = None

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
