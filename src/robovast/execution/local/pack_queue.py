"""Which runs of a local campaign the next worker starts."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Condition, Lock
from typing import Protocol

from robovast.base.sequential import Decision, SequentialTest
from robovast.campaign.decisions import decide, runs_to_start
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.model.packing import PackSample
from robovast.model.packs import PlanSpec
from robovast.model.plan import PackStart, Run, pack_runs


@dataclass(frozen=True, slots=True)
class Decided:
    """A configuration whose runs are enough."""

    variant: str
    decision: Decision
    spared: int
    """Its runs that are not started any more."""


class PackQueue(Protocol):
    """Hands out runs to workers; all methods may be called from any thread."""

    def take(self) -> PackStart | None:
        """The runs to start next; None when there are none."""

    def put_back(self, runs: Sequence[Run]) -> None:
        """Hand out runs once more that were taken and not started."""

    def ended(self, run: Run, verdict: Verdict) -> Decided | None:
        """Take note of a run's verdict; returns the decision that it brings about."""

    def measured(self, sample: PackSample) -> None:
        """Take note of how long a pack took; where that decides nothing, nothing is done."""
        del sample


class FixedQueue(PackQueue):
    """Every run, in order."""

    def __init__(self, plan: PlanSpec, runs: Sequence[Run], first_job: int) -> None:
        self._plan = plan
        self._lock = Lock()
        self._next_job = first_job
        self._packs: deque[PackStart] = deque()
        self.put_back(runs)

    def take(self) -> PackStart | None:
        """The next pack."""
        with self._lock:
            return self._packs.popleft() if self._packs else None

    def put_back(self, runs: Sequence[Run]) -> None:
        """Put runs after all others."""
        with self._lock:
            packs = pack_runs(self._plan, runs, self._next_job)
            self._next_job += len(packs)
            self._packs.extend(packs)

    def ended(self, run: Run, verdict: Verdict) -> None:
        """Decide nothing."""
        del run, verdict


class GrowingQueue(FixedQueue):
    """Every run, in order; workers wait for further ones until it is closed."""

    def __init__(self, plan: PlanSpec, first_job: int) -> None:
        self._changed = Condition()
        self._closed = False
        super().__init__(plan, (), first_job)

    def take(self) -> PackStart | None:
        """The next pack, as soon as there is one; None when the queue is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._packs)
            return None if self._closed else super().take()

    def put_back(self, runs: Sequence[Run]) -> None:
        """Put runs after all others."""
        with self._changed:
            super().put_back(runs)
            self._changed.notify_all()

    def add(self, plan: PlanSpec, runs: Sequence[Run]) -> None:
        """Put runs of a longer plan after all others."""
        with self._changed:
            self._plan = plan
            self.put_back(runs)

    def reserve(self, jobs: int) -> int:
        """Reserve numbers of jobs; returns the first of them."""
        with self._changed:
            self._next_job += jobs
            return self._next_job - jobs

    def close(self) -> None:
        """Hand out nothing any more."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


@dataclass
class _Variant:
    """The runs of a configuration under way."""

    name: str
    test: SequentialTest
    left: dict[int, Run] = field(default_factory=dict)
    """Runs to start, by number, in order."""
    verdicts: dict[int, Verdict] = field(default_factory=dict)
    decision: Decision = field(init=False)

    def __post_init__(self) -> None:
        self.decide()

    def decide(self) -> None:
        """Ask the test."""
        self.decision = decide(self.test, self.verdicts)

    @property
    def ahead(self) -> int:
        """By how much the next run may not be needed; 0 if it surely is."""
        first, decision = next(iter(self.left)), self.decision
        return max(0, first + 1 - decision.runs - decision.further)


class DecidingQueue(PackQueue):
    """As many runs of each configuration as a sequential test needs.

    Runs that are needed in any case come first. Only when all of these are under way does a worker
    run ahead instead of waiting: such a run is stored and counts in rates, but a decision that an
    earlier one brings about stays as it is.
    """

    def __init__(
        self,
        test: SequentialTest,
        runs: Iterable[Run],
        done: Mapping[int, RunRecord],
        first_job: int,
        runs_per_job: int,
    ) -> None:
        self._lock = Lock()
        self._next_job = first_job
        self._runs_per_job = runs_per_job
        self._variants = _variants(test, runs, done)
        self.decided_before = [
            Decided(one.name, one.decision, len(one.left))
            for one in self._variants.values()
            if one.decision.is_over
        ]
        """What the runs of earlier sessions decide."""

    def take(self) -> PackStart | None:
        """Runs that are needed in any case, else one that may be."""
        with self._lock:
            waiting = [
                one for one in self._variants.values() if one.left and not one.decision.is_over
            ]
            if not waiting:
                return None
            chosen = min(waiting, key=lambda one: one.ahead)
            numbers = runs_to_start(chosen.decision, list(chosen.left), self._runs_per_job)
            runs = [chosen.left.pop(number) for number in numbers]
            self._next_job += 1
            return PackStart(self._next_job - 1, tuple(runs))

    def put_back(self, runs: Sequence[Run]) -> None:
        """Put runs where they were."""
        with self._lock:
            for run in runs:
                variant = self._variants[run.variant.name]
                left = {**variant.left, run.number: run}
                variant.left = dict(sorted(left.items()))

    def ended(self, run: Run, verdict: Verdict) -> Decided | None:
        """Ask the test."""
        with self._lock:
            variant = self._variants[run.variant.name]
            variant.verdicts[run.number] = verdict
            if variant.decision.is_over:
                return None
            variant.decide()
            if not variant.decision.is_over:
                return None
            return Decided(variant.name, variant.decision, len(variant.left))


def _variants(
    test: SequentialTest, runs: Iterable[Run], done: Mapping[int, RunRecord]
) -> dict[str, _Variant]:
    planned: dict[str, list[Run]] = {}
    for run in runs:
        planned.setdefault(run.variant.name, []).append(run)
    return {
        name: _Variant(
            name,
            test.at_most(len(own)),
            {run.number: run for run in own if run.id not in done},
            {run.number: done[run.id].verdict for run in own if run.id in done},
        )
        for name, own in planned.items()
    }


def decisions_of(
    test: SequentialTest, runs: Sequence[Run], records: Mapping[int, RunRecord]
) -> list[Decided]:
    """What is known of every configuration in the end."""
    variants = _variants(test, runs, records).values()
    return [
        Decided(one.name, one.decision, len(one.left) if one.decision.is_over else 0)
        for one in variants
    ]
