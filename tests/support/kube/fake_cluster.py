"""A cluster in a few dictionaries: what Jobs do, as far as decisions depend on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import Any

from robovast.base.ranges import count, format_ranges, merge, parse_ranges, spans, truncate
from robovast.campaign.decisions import decide as decide_runs
from robovast.campaign.verdict import Verdict
from robovast.kubeapi.pod_contract.messages import Proposed
from robovast.kubeapi.status import CampaignStatus, Runs
from robovast.model.packing import Pace
from robovast.model.repetition import GroupSizes, list_name, list_text, parse_list, retry_groups
from robovast_operator.decide import (
    AppendRuns,
    CampaignDecision,
    CreateShard,
    CreateTask,
    CreateUpload,
    DeleteJob,
    DeletePlan,
    ResizeJob,
    SuspendJob,
    decide,
)
from robovast_operator.kube.store import JobState
from robovast_operator.kube.times import format_time
from robovast_operator.planning.accept import accept
from robovast_operator.planning.campaign import Accepted, Revision
from robovast_operator.planning.proposals import first_plan
from robovast_operator.planning.revisions import next_revision
from robovast_operator.planning.shards import ShardPlan
from robovast_operator.pods.observations import Final, PodFindings
from robovast_operator.pods.verdicts import Report
from robovast_operator.settings import OperatorSettings
from robovast_operator.snapshot import Snapshot

SETTINGS = OperatorSettings(agent_image="agent:1", endpoint="http://s3:9000")

SCENARIO = """scenario try_it:
    speed: float = 1.0
    do serial:
        wait elapsed(1s)
"""


def campaign(**spec: Any) -> dict[str, Any]:
    """A Campaign object of one entry with three variants."""
    vast = {
        "version": 1,
        "configuration": [
            {
                "name": "hall",
                "variations": [
                    {"ParameterVariationList": {"name": "speed", "values": [1.0, 2.0, 3.0]}}
                ],
            }
        ],
        "execution": {"image": "runs:1", "scenario_file": "scenario.osc"},
    }
    return {
        "apiVersion": "robovast.io/v1beta1",
        "kind": "Campaign",
        "metadata": {
            "namespace": "lab",
            "name": "drive",
            "uid": "0123-4567",
            "creationTimestamp": "2026-11-21T07:00:00Z",
            "generation": 1,
            "resourceVersion": "1",
        },
        "spec": {"vast": vast, "source": {"inline": {"files": {"scenario.osc": SCENARIO}}}, **spec},
    }


SEARCH = {
    "strategy": "random",
    "search_space": {"speed": {"type": "float", "low": 0, "high": 1}},
    "objectives": [{"name": "failure_rate"}],
    "budget": [{"batches": 3}],
}


AS_NEEDED = {"min": 2, "max": 6, "decide": {"good": 0.1, "bad": 0.6, "error": 0.1}}


def accepted(
    search: dict[str, Any] | None = None,
    as_needed: dict[str, Any] | None = None,
    execution: dict[str, Any] | None = None,
    **spec: Any,
) -> Accepted:
    """The campaign, accepted; perhaps with a search in place of its entry, or runs as needed."""
    obj = campaign(**spec)
    obj["spec"]["vast"]["execution"] |= execution or {}
    if as_needed is not None:
        obj["spec"]["vast"]["execution"]["runs"] = as_needed
    if search is not None:
        del obj["spec"]["vast"]["configuration"]
        obj["spec"]["vast"]["search"] = search
    files = {"scenario.osc": SCENARIO.encode()}
    made = accept(obj, files, SETTINGS)
    assert isinstance(made, Accepted), made
    return made


@dataclass
class FakeJob:
    """A Job and the verdicts of its runs."""

    name: str
    role: str
    size: int
    parallelism: int
    shard: ShardPlan | None = None
    done: dict[int, str] = field(default_factory=dict)
    """Verdict by completion index."""
    suspended: bool = False
    deleting: bool = False
    """It is still there because pods of it are."""
    ended: str = ""
    """When its last pod ended."""
    ready: int | None = None
    """Pods that are at work; all that are there when None."""
    queue: str = ""
    """Kueue's LocalQueue."""

    @property
    def over(self) -> bool:
        return len(self.done) == self.size

    def state(self) -> JobState:
        bad = [index for index, verdict in self.done.items() if verdict != "passed"]
        good = [index for index, verdict in self.done.items() if verdict == "passed"]
        finished = "" if not self.over else "Failed" if bad else "Complete"
        active = 0 if self.over or self.suspended else min(
            self.parallelism, self.size - len(self.done)
        )  # fmt: skip
        return JobState(
            namespace="lab",
            name=self.name,
            uid=f"uid-{self.name}",
            campaign="drive",
            campaign_uid="0123-4567",
            role=self.role,
            resource_version="1",
            parallelism=self.parallelism,
            suspended=self.suspended,
            active=active,
            ready=active if self.ready is None else self.ready,
            completed=format_ranges(spans(good)),
            failed=format_ranges(spans(bad)),
            finished=finished,
            reason="FailedIndexes" if finished == "Failed" else "",
            message="",
            deleting=self.deleting,
            size=self.size,
            queue=self.queue,
            configuration=self.shard.owner["uid"] if self.shard and self.shard.owner else "",
        )


class World:
    """A cluster with one campaign, and an operator that may be killed at any moment."""

    def __init__(self, campaign: Accepted) -> None:
        self.accepted = campaign
        self.status = CampaignStatus()
        self.revisions: list[Revision] = []
        self.jobs: dict[str, FakeJob] = {}
        self.stored: dict[int, str] = {}
        """Verdict by run id, as in the bucket."""
        self.executed: list[int] = []
        """Run ids in the order in which they were stored."""
        self.created: list[str] = []
        self.uploads: list[str] = []
        """Names of the Jobs that upload results, each as often as it was made."""
        self._groups: dict[str, list[list[int]]] = {}
        self.mute: set[str] = set()
        """Finish Jobs whose pods are gone."""
        self.unseen: dict[str, set[int]] = {}
        """Failed indexes whose pods have not been looked at, by Job."""
        self.lists: dict[str, str] = {}
        """Lists of bad runs by name, as in the bucket."""
        self.withdrawn: frozenset[str] = frozenset()
        self.taken: frozenset[str] = frozenset()
        """Names of Jobs that others have taken."""
        """What the installation lets it have now."""
        self.now = datetime(2026, 11, 21, 8, tzinfo=UTC)
        self.variant_limit = SETTINGS.variant_limit
        self.pace: Pace | None = Pace(start=10.0, run=1.0)
        """What the operator has measured, where packs are measured."""
        self.totals: list[int] = []
        """Runs of each plan of a search that was made of what it proposed."""
        self.batches: list[Proposed] = []
        """What the propose Jobs of a search say, the first one's words first."""
        if not campaign.is_search:
            self.plan_more()

    def begin(self, *batches: Proposed) -> None:
        """Take what a search will propose, of which the first is planned."""
        self.batches = list(batches)
        first = first_plan(self.accepted, batches[0], "plan-0", 1000, "")
        assert isinstance(first, Revision), first
        self.revisions.append(first)
        self.totals = [first.plan.total]

    def plan_more(self) -> None:
        """Fix what is asked for in a plan."""
        number = self.revisions[-1].number + 1 if self.revisions else 0
        name = self.accepted.identity.child(f"plan-{number}")
        new = next_revision(self.accepted, self.revisions, (), name)
        if new is not None:
            self.revisions.append(new)

    def ask(self, **spec: Any) -> None:
        """Change the Campaign's spec."""
        self.accepted = replace(self.accepted, spec=self.accepted.spec.model_copy(update=spec))
        self.plan_more()

    def look(self, *, dies: str = "") -> CampaignDecision:
        """One look of the operator; it may die `before` its status is written, or `amid` acts."""
        self.now += timedelta(seconds=1)
        going = [name for name, job in self.jobs.items() if job.deleting]
        decision = decide(self.snapshot())
        acts = decision.actions[:1] if dies == "amid" else decision.actions
        for action in acts:
            self._act(action)
        if dies:
            return decision
        self.status = decision.status
        for action in decision.later:
            self._act(action)
        for name in going:
            self.jobs.pop(name, None)
        return decision

    def snapshot(self) -> Snapshot:
        return Snapshot(
            accepted=self.accepted,
            generation=1,
            status=self.status,
            revisions=self.revisions,
            jobs={name: replace(job.state(), ended=job.ended) for name, job in self.jobs.items()},
            now=self.now,
            variant_limit=self.variant_limit,
            withdrawn=self.withdrawn,
            taken=self.taken,
            pods=PodFindings(
                reports={name: self._reports(job) for name, job in self.jobs.items()},
                finals={
                    name: self._final()
                    for name, job in self.jobs.items()
                    if job.role == "finish" and job.over and name not in self.mute
                },
                proposals={
                    name: self.batches[int(name.partition("-propose-")[2].partition("-")[0])]
                    for name, job in self.jobs.items()
                    if job.role == "propose" and job.over and name not in self.mute
                },
                pace=self.pace,
            ),
        )

    def work(self, verdict: str = "passed", which: int = 0) -> bool:
        """Let one pod end; False when none is there."""
        return self.work_as(lambda _: verdict, which)

    def work_as(self, verdict: Callable[[int], str], which: int = 0) -> bool:
        """Let one pod end, each run as its id says; False when none is there."""
        busy = [job for job in self.jobs.values() if job.state().active]
        if not busy:
            return False
        job = busy[which % len(busy)]
        index = next(i for i in range(job.size) if i not in job.done)
        job.ended = format_time(self.now)
        given = "passed"
        for id_ in self._ids(job, index):
            if self._is_decided(id_):
                break
            given = verdict(id_)
            attempted = (job.shard.attempt if job.shard else 1) > 1
            if id_ not in self.stored or (attempted and self.stored[id_] != "passed"):
                self.executed.append(id_)
                self.stored[id_] = given
        bad = any(self.stored.get(id_, "passed") != "passed" for id_ in self._ids(job, index))
        job.done[index] = (given if given != "passed" else "failed") if bad else "passed"
        return True

    def work_all(self, verdict: Callable[[int], str]) -> None:
        """Let all pods of all open Jobs end, each run as its id says."""
        for job in self.jobs.values():
            busy = job.role == "shard" and not job.suspended
            for index in range(job.size if busy and not job.over else 0):
                for id_ in self._ids(job, index):
                    self.executed.append(id_)
                    self.stored[id_] = verdict(id_)
                found = {self.stored[id_] for id_ in self._ids(job, index)}
                bad = [kind for kind in ("errored", "failed") if kind in found]
                job.done.setdefault(index, bad[0] if bad else "passed")

    def meet(self, kind: str, which: int, verdict: str) -> None:
        """Let one thing happen: `look`, `dies before`, `dies amid` or `work`; no other kind."""
        match kind:
            case "look":
                self.look()
            case "dies before" | "dies amid":
                self.look(dies=kind.split()[1])
            case "work":
                self.work(verdict, which)

    def settle(self, verdict: str = "passed", looks: int = 400) -> None:
        """Go on until nothing happens any more."""
        for _ in range(looks):
            before = (self.status, len(self.created))
            self.look()
            if not self.work(verdict) and before == (self.status, len(self.created)):
                return
        raise AssertionError(f"no end: {self.status}")

    def truth(self, name: str) -> str:
        """A condition's status."""
        return next(c.status for c in self.status.conditions if c.type == name)

    def truth_of(self, name: str) -> str:
        """A condition's status, empty before the first look."""
        return self.truth(name) if self.status.conditions else ""

    @property
    def pods(self) -> int:
        return sum(
            job.parallelism for job in self.jobs.values() if job.role == "shard" and not job.over
        )

    def _ids(self, job: FakeJob, index: int) -> list[int]:
        """The runs of a pod, as its fetch container finds them."""
        if job.shard is None:
            return []
        plan, pack = self.revisions[-1].plan, job.shard.first_pack + index
        if not job.shard.repeat:
            return list(plan.pack(pack))
        name = job.shard.repeat
        if name not in self._groups:
            text = self.lists[name].encode()
            self._groups[name] = retry_groups(plan, parse_list(name, text))
        return self._groups[name][pack]

    def _is_decided(self, id_: int) -> bool:
        """Whether the stored runs before it decide about its variant."""
        plan, test = self.revisions[-1].plan, self.accepted.vast.execution.test()
        if test is None:
            return False
        ids = plan.numbers_of(plan.run(id_)[0])
        stored = {n: Verdict(self.stored[i]) for n, i in ids.items() if i in self.stored}
        return decide_runs(replace(test, most=None), stored).is_over

    def _reports(self, job: FakeJob) -> dict[int, Report]:
        reports = {}
        for index, verdict in job.done.items():
            if verdict == "lost" or index in self.unseen.get(job.name, ()):
                continue
            ids: dict[str, list[int]] = {"passed": [], "failed": [], "errored": []}
            known = [id_ for id_ in self._ids(job, index) if id_ in self.stored]
            for id_ in known:
                ids[self.stored[id_]].append(id_)
            reports[index] = Report(
                *(len(found) for found in ids.values()),
                tuple(spans(ids["failed"])),
                tuple(spans(ids["errored"])),
                len(self._ids(job, index)) - len(known),
                final=True,
            )
        return reports

    def _final(self) -> Final:
        """What finish finds in the bucket, and stores there."""
        total = self.revisions[-1].plan.total
        spared = {id_ for id_ in range(total) if id_ not in self.stored and self._is_decided(id_)}
        verdicts = [
            self.stored.get(i, "spared" if i in spared else "errored") for i in range(total)
        ]
        by = {
            kind: spans(id_ for id_, found in enumerate(verdicts) if found in names)
            for kind, names in (("failed", ["failed"]), ("errored", ["errored", "lost"]))
        }
        numbers = {kind: count(found) for kind, found in by.items()}
        passed = total - sum(numbers.values()) - len(spared)
        runs = Runs(total=total, passed=passed, not_needed=len(spared), **numbers)
        bad = merge([*by["failed"], *by["errored"]])
        text = list_text(bad)
        name = list_name(text) if bad else ""
        self.lists[name] = text
        sizes = str(GroupSizes.of(retry_groups(self.revisions[-1].plan, bad)))
        told = [truncate(format_ranges(ids), 1500) for ids in (by["failed"], by["errored"])]
        texts = [parse_ranges(text) for text, _ in told]
        return Final(runs, *texts, any(cut for _, cut in told), (), name, sizes)

    def _act(self, action: object) -> None:
        match action:
            case CreateShard(shard):
                self._create(FakeJob(shard.job, "shard", shard.size, shard.parallelism, shard))
            case CreateTask(command, name, _):
                self._create(FakeJob(name, command, 1, 1))
            case CreateUpload(name):
                self.uploads.append(name)
            case AppendRuns(plan):
                if plan.number == self.revisions[-1].number + 1:  # as for Jobs
                    self.revisions.append(plan)
                    self.totals.append(plan.plan.total)
            case DeletePlan(config_map):
                self._delete_plan(config_map)
            case SuspendJob(job, suspend):
                self.jobs[job].suspended = suspend
            case ResizeJob(job, parallelism):
                self.jobs[job].parallelism = parallelism
            case DeleteJob(job):
                self.jobs[job].deleting = True

    def _delete_plan(self, config_map: str) -> None:
        waiting = [job.shard.plan for job in self.jobs.values() if job.shard and not job.over]
        assert config_map not in waiting, "its pods could not begin"
        assert config_map != self.revisions[0].config_map
        self.revisions = [r for r in self.revisions if r.config_map != config_map]

    def _create(self, job: FakeJob) -> None:
        if job.name not in self.jobs:  # the API server answers 409, which is as good
            self.created.append(job.name)
            self.jobs[job.name] = job


def bad(world: World) -> list[int]:
    """Ids that the status calls bad."""
    text = [world.status.failed_runs, world.status.errored_runs]
    return sorted(i for t in text for a, b in parse_ranges(t) for i in range(a, b + 1))
