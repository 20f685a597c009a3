"""The state of one campaign at one moment, and what follows from it. Pure functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property

from robovast.base.ranges import merge
from robovast.kubeapi.status import (
    SHARDS_LIMIT,
    BadRuns,
    CampaignStatus,
    Settled,
    Shard,
)
from robovast.model.expansion.limit import DEFAULT
from robovast.model.packs import PlanSpec
from robovast.model.repetition import GroupSizes
from robovast_operator.kube.conditions import is_true
from robovast_operator.kube.store import JobState
from robovast_operator.kube.untrusted_fields import ranges
from robovast_operator.planning.campaign import Accepted, Revision
from robovast_operator.planning.measured_packs import PlanningRounds
from robovast_operator.planning.shards import WINDOW, ShardPlan, first_attempts, repetitions
from robovast_operator.pods.job_attempts import TASK_PODS_LOST, Tries, number_of
from robovast_operator.pods.observations import Final, PodFindings, Trouble
from robovast_operator.pods.verdicts import ShardRuns, Tally, tally_of, total
from robovast_operator.pods.waiting import QueueFindings, Waiting
from robovast_operator.search import SearchState


@dataclass(frozen=True)
class Snapshot:
    """The state of a campaign's objects at one moment, and what follows from it."""

    accepted: Accepted
    generation: int
    status: CampaignStatus
    revisions: Sequence[Revision]
    jobs: Mapping[str, JobState]
    now: datetime
    pods: PodFindings = field(default_factory=PodFindings)
    queue: QueueFindings = field(default_factory=QueueFindings)
    taken: frozenset[str] = frozenset()
    """Names of the campaign's Jobs under which others have made theirs."""
    foreign: Trouble | None = None
    """What that is in the way of."""
    variant_limit: int = DEFAULT
    """Most variants of a document."""
    withdrawn: frozenset[str] = frozenset()
    """Configurations that are gone, by uid: nothing more is executed of their runs."""

    @cached_property
    def shards(self) -> Sequence[ShardPlan]:
        """Return the shards that are not settled: first attempts, then repetitions."""
        identity, status, settled = self.accepted.identity, self.status, self.status.settled
        shards = first_attempts(identity, self.revisions)[settled.first :]
        if status.bad is not None and status.attempt > status.bad.attempt:
            size = self.plan.runs_per_start
            again = repetitions(identity, status.bad, status.attempt, size)
            shards += again[settled.repeated :]
        return shards

    @cached_property
    def records(self) -> Mapping[str, Shard]:
        """Return the records of shards in the status, by Job."""
        return {record.job: record for record in self.status.shards}

    @cached_property
    def tallies(self) -> Mapping[str, Tally]:
        """Return the verdicts of the shards' runs, by Job."""
        return {shard.job: self._tally(shard) for shard in self.shards}

    def _tally(self, shard: ShardPlan) -> Tally:
        """Return the verdicts of a shard's runs: from the status after its end, else its Job."""
        record, job = self.records.get(shard.job), self.job(shard)
        if record is not None and record.state in {"Complete", "Failed"}:
            counts = (record.passed, record.failed, record.errored)
            return Tally(*counts, not_needed=record.not_needed)
        if job is None:
            return Tally()
        return tally_of(self.runs_of(shard), job, self.pods.reports.get(job.name, {}))

    @cached_property
    def aborted(self) -> Trouble | None:
        """Return why the campaign is aborted; None if the campaign is not aborted."""
        for condition in self.status.conditions:
            if condition.type == "Succeeded" and condition.status == "False":
                return Trouble(condition.reason, condition.message, final=True)
        if self.pods.trouble is not None and self.pods.trouble.final:
            return self.pods.trouble
        if isinstance(self.search.growth, str):
            return Trouble("InvalidPlan", self.search.growth, final=True)
        limits, tally = self.accepted.spec.fail_fast, self.tally
        for name, limit, found in (
            ("failed", limits.max_failed, tally.failed),
            ("errored", limits.max_errored, tally.errored),
        ):
            if limit is not None and found > limit and not self.all_done:
                message = (
                    f"{found} runs {name}, but spec.failFast allows {limit}. List the runs with "
                    "`vast exec cluster runs --failed`, and raise spec.attempt to repeat the runs."
                )
                return Trouble("FailFast", message, final=True)
        return None

    @cached_property
    def given_up(self) -> Trouble | None:
        """Return why the campaign is aborted, unless unsuccessful runs are repeated."""
        return None if self.repeats else self.aborted

    @cached_property
    def trouble(self) -> Trouble | None:
        """Return the trouble that keeps the campaign from going on now."""
        if self.pods.trouble is not None or self.foreign is not None:
            return self.pods.trouble or self.foreign
        if self.repetition_due and self.all_indexed and not self.repeats:
            return Trouble(
                "RunListMissing",
                "The index Job has stored no list of the unsuccessful runs. Check that operator "
                "and agent have the same version.",
            )
        problem = self.finish.problem if self.lost_summary else ""
        problem = self.search.proposing.problem if self.lost_proposal else problem
        return Trouble(TASK_PODS_LOST, problem) if problem else None

    @cached_property
    def plan(self) -> PlanSpec:
        """Return the newest plan."""
        return self.revisions[-1].plan

    @cached_property
    def search(self) -> SearchState:
        """Return the campaign's search; most of it is empty without a search."""
        return SearchState(
            self.accepted,
            self.revisions,
            self.status.search,
            self.jobs,
            self.pods.proposals,
            self.variant_limit,
        )

    @cached_property
    def rounds(self) -> PlanningRounds:
        """Return the rounds in which runs are put into packs, where packs are measured."""
        newest, identity = self.revisions[-1], self.accepted.identity
        return PlanningRounds(
            identity, newest, self.open, self.accepted.spec.parallelism, self.pods.pace
        )

    @cached_property
    def past_plans(self) -> list[str]:
        """Return plans of a search that are no longer read, because later plans include them.

        The first one stays, and so do the last few: a replica that was stopped for a while may make
        its next one no more if another has.
        """
        if not self.accepted.is_search:
            return []
        wanted = {shard.plan for shard in self.shards if not self._is_past(shard)}
        if self.status.bad is not None and self.status.bad.runs:
            wanted.add(self.status.bad.plan)
        return [r.config_map for r in self.revisions[1:-WINDOW] if r.config_map not in wanted]

    def _is_past(self, shard: ShardPlan) -> bool:
        """Return whether no pod of a shard will begin."""
        job = self.job(shard)
        return self.ended(shard) and (job is None or not job.open)

    def job(self, shard: ShardPlan) -> JobState | None:
        """Return the Job of a shard; None without a Job."""
        return self.tries(shard).last

    def tries(self, shard: ShardPlan) -> Tries:
        """Return the Jobs of a shard; an earlier Job exists until its successor exists."""
        return self._tries.get(shard.job, Tries(shard.job, ()))

    @cached_property
    def _tries(self) -> Mapping[str, Tries]:
        first_names = {shard.job for shard in self.shards}
        found: dict[str, list[JobState]] = {}
        for name, job in self.jobs.items():
            first = name if name in first_names else name.rpartition("-")[0]
            if first in first_names and number_of(name, first) is not None:
                found.setdefault(first, []).append(job)
        return {first: Tries.of(jobs, first) for first, jobs in found.items()}

    @cached_property
    def replaced(self) -> list[JobState]:
        """Return Jobs of shards whose place others have taken."""
        return [job for tries in self._tries.values() for job in tries.old]

    def runs_of(self, shard: ShardPlan) -> ShardRuns:
        """Return the runs of a shard."""
        bad = self.status.bad
        sizes = GroupSizes.parse(bad.sizes if bad is not None else "")
        return ShardRuns(self.plan, shard, sizes)

    def is_withdrawn(self, shard: ShardPlan) -> bool:
        """Return whether the Configuration that requested a shard is deleted, and so its Job."""
        return shard.owner is not None and shard.owner["uid"] in self.withdrawn

    def ended(self, shard: ShardPlan) -> bool:
        """Return whether a shard has ended."""
        record, job = self.records.get(shard.job), self.job(shard)
        if self.is_withdrawn(shard):
            return True
        if record is not None and record.state in {"Complete", "Failed"}:
            return True
        return job is not None and not job.open

    def is_remembered(self, shard: ShardPlan) -> bool:
        """Return whether the status has the end of a shard and the verdicts of all its runs."""
        record = self.records.get(shard.job)
        if record is None or record.state not in {"Complete", "Failed"}:
            return False
        return self.tallies[shard.job].settled == self.runs_of(shard).all

    @cached_property
    def open(self) -> list[JobState]:
        """Return running Jobs of shards, oldest first."""
        jobs = ((shard, self.job(shard)) for shard in self.shards)
        return [job for shard, job in jobs if job is not None and not self.ended(shard)]

    @cached_property
    def not_begun(self) -> list[ShardPlan]:
        """Return shards that may get a Job now, limited by the size of the status."""
        begun = next((n for n, shard in enumerate(self.shards) if not self.ended(shard)), 0)
        near = self.shards[: begun + SHARDS_LIMIT]
        due = [s for s in near if s.after <= self.status.settled.first + begun]
        waiting = [s for s in due if self.job(s) is None and not self.ended(s)]
        return [shard for shard in waiting if shard.job not in self.taken]

    @cached_property
    def held(self) -> Waiting | None:
        """Return why the whole campaign waits for quota; None if a part of it has quota."""
        return self.queue.waiting if all(job.suspended for job in self.open) else None

    @cached_property
    def all_ended(self) -> bool:
        """Return whether every shard has ended, and no Job that repeats runs is left."""
        names = {job.name for tries in self._tries.values() for job in tries.jobs}
        jobs = self.jobs.values()
        strays = (job for job in jobs if job.role == "shard" and job.name not in names)
        return all(self.ended(shard) for shard in self.shards) and not any(j.open for j in strays)

    @cached_property
    def all_done(self) -> bool:
        """Return whether every shard has ended and no further shard will follow."""
        return self.all_ended and not self.search.goes_on and not self.rounds.unpacked

    @cached_property
    def packing(self) -> Revision | None:
        """Return the plan with further packs if pods would be idle without packs; else None."""
        if self.aborted is not None:
            return self.rounds.last
        return None if self.not_begun else self.rounds.next

    @cached_property
    def quiet(self) -> bool:
        """Return whether no runs are left, apart from unsuccessful runs to repeat."""
        return self.aborted is not None or self.all_done

    @cached_property
    def awaited(self) -> Sequence[ShardPlan]:
        """Return the unsettled shards that must end before the search proposes more runs."""
        runs = sum(block.size for block in self.plan.awaited_blocks)
        packs = self.plan.pack_of(runs - 1) + 1 if runs else 0
        return [shard for shard in self.shards if not shard.repeat and shard.first_pack < packs]

    @cached_property
    def due_to_propose(self) -> bool:
        """Return whether the search may propose now, because the awaited runs have finished."""
        waits = self.search.goes_on and not self.quiet
        return waits and all(self.ended(shard) for shard in self.awaited)

    @cached_property
    def idle(self) -> bool:
        """Return whether no run is in progress until the search proposes the next runs."""
        return self.due_to_propose and self.all_ended

    @cached_property
    def lost_proposal(self) -> bool:
        """Return whether a propose Job succeeded, but its termination message is lost."""
        search = self.search
        return search.proposing.ended_well and self.due_to_propose and search.proposed is None

    @cached_property
    def attempt(self) -> int:
        """Return the current attempt. Attempts without unsuccessful runs complete at once."""
        spec, status = self.accepted.spec, self.status
        return (
            status.attempt
            if self.repetition_due and not self.repeats
            else max(spec.attempt, status.attempt)
        )

    @cached_property
    def repetition_due(self) -> bool:
        """Return whether unsuccessful runs are to be repeated."""
        none_bad = self.all_indexed and self.bad is not None and not self.bad.runs
        return self.accepted.spec.attempt > self.status.attempt and not none_bad

    @cached_property
    def repeats(self) -> bool:
        """Return whether unsuccessful runs can be repeated now, because the list exists."""
        listed = self.all_indexed and self.bad is not None and bool(self.bad.list)
        return self.repetition_due and listed

    @cached_property
    def over(self) -> bool:
        """Return whether no runs are left."""
        return self.quiet and not self.repetition_due

    @cached_property
    def ended_shards(self) -> int:
        """Return how many shards have ended."""
        return self.status.settled.shards + sum(self.ended(s) for s in self.shards)

    @cached_property
    def finish(self) -> Tries:
        """Return the Jobs that create the index; each set of shards has its own Jobs."""
        task = self.accepted.identity.child(f"finish-{self.ended_shards}")
        return Tries.of(self.jobs.values(), task)

    @cached_property
    def indexed(self) -> bool:
        """Return whether the index in the bucket covers everything that ran."""
        status = self.status
        covered = status.finished_shards == self.ended_shards
        recorded = covered and is_true(status, "ResultsAvailable")
        return self.over and (recorded or (self.final is not None and self.processed))

    @cached_property
    def results(self) -> str:
        """Return the version of complete results, by attempt and shards; else empty."""
        return f"{self.attempt}-{self.ended_shards}" if self.indexed else ""

    @cached_property
    def process_name(self) -> str:
        """Return the name of the Job that processes the results of the current set of shards."""
        return self.accepted.identity.child(f"process-{self.ended_shards}")

    @cached_property
    def processed(self) -> bool:
        """Return whether the results were processed, with or without success, if requested."""
        job = self.jobs.get(self.process_name)
        asked = self.accepted.spec.process_results
        return not asked or (job is not None and not job.open)

    @cached_property
    def final(self) -> Final | None:
        """Return the result of the finish Job of these shards; None before its end."""
        if not self.quiet:
            return None
        task = self.finish.task
        found = (f for name, f in self.pods.finals.items() if number_of(name, task) is not None)
        return next((final for final in found if final.runs.total == self.plan.total), None)

    @cached_property
    def lost_summary(self) -> bool:
        """Return whether the finish Job succeeded, but its termination message is lost."""
        ended = self.finish.ended_well
        return ended and self.over and not self.indexed and self.final is None

    @cached_property
    def bad(self) -> BadRuns | None:
        """Return the unsuccessful runs in the last index of the bucket."""
        status, final = self.status, self.final
        if final is None:
            return status.bad
        return BadRuns(
            shards=self.ended_shards,
            total=final.runs.total,
            attempt=status.attempt,
            plan=self.revisions[-1].config_map,
            runs=final.runs.failed + final.runs.errored,
            list=final.list,
            sizes=final.sizes,
        )

    @cached_property
    def decisions(self) -> str:
        """Return the decisions about configurations in the last index of the bucket."""
        return self.status.decisions if self.final is None else self.final.decisions

    @cached_property
    def all_indexed(self) -> bool:
        """Return whether that index covers everything that ran."""
        bad = self.bad
        covered = (self.ended_shards, self.plan.total)
        return self.quiet and bad is not None and (bad.shards, bad.total) == covered

    @cached_property
    def settled(self) -> Settled:
        """Return the totals of the shards in the index, which the status no longer lists."""
        settled, final = self.status.settled, self.final
        if final is not None:
            settled = Settled(
                shards=self.ended_shards,
                first=len(first_attempts(self.accepted.identity, self.revisions)),
                passed=final.runs.passed,
                failed=final.runs.failed,
                errored=final.runs.errored,
                not_needed=final.runs.not_needed,
            )
        if self.repeats:  # what was bad has no verdict now
            settled = settled.model_copy(update={"failed": 0, "errored": 0, "repeated": 0})
        return settled

    @cached_property
    def tally(self) -> Tally:
        """Return the current verdicts of all runs."""
        settled = self.status.settled
        before = Tally(
            settled.passed, settled.failed, settled.errored, not_needed=settled.not_needed
        )
        return total([before, *self.tallies.values()])

    @cached_property
    def undecided(self) -> int:
        """Return how many runs have ended with an unknown verdict."""
        return sum(self._undecided(shard) for shard in self.shards)

    def _undecided(self, shard: ShardPlan) -> int:
        runs, job = self.runs_of(shard), self.job(shard)
        if self.ended(shard):
            ended = runs.all
        elif job is not None:
            ended = runs.number(
                merge([*ranges(job.completed, shard.size), *ranges(job.failed, shard.size)])
            )
        else:
            return 0
        return max(0, ended - self.tallies[shard.job].settled)
