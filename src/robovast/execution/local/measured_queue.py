"""Packs of a local campaign by what starts and runs have taken (`runs_per_job: auto`)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from threading import Lock

from robovast.campaign.verdict import Verdict
from robovast.execution.local.pack_queue import PackQueue
from robovast.model.packing import PackSample, next_packs, pace_of
from robovast.model.packs import PlanSpec
from robovast.model.plan import PackStart, Run


class MeasuredQueue(PackQueue):
    """Every run, in order; each pack is as large as a pod's in a cluster would be."""

    def __init__(self, plan: PlanSpec, runs: Sequence[Run], first_job: int, workers: int) -> None:
        self._plan = plan
        self._left = list(runs)
        self._next_job = first_job
        self._workers = workers
        self._last = 0
        self._planned = 0
        """How many of the next runs are in packs of the same size as the last one."""
        self._samples: list[PackSample] = []
        self._lock = Lock()

    def take(self) -> PackStart | None:
        """The next pack, of runs that may share one."""
        with self._lock:
            if not self._left:
                return None
            if not self._planned:
                self._plan_round()
            stretch = self._plan.stretch_of(self._left[0].id)
            near = self._left[: min(self._last, self._planned)]
            runs = list(takewhile(lambda run: self._plan.stretch_of(run.id) == stretch, near))
            self._left = self._left[len(runs) :]
            self._planned -= len(runs)
            self._next_job += 1
            return PackStart(self._next_job - 1, tuple(runs))

    def _plan_round(self) -> None:
        """Choose the size of the next packs."""
        measured = 2 * len(self._samples) >= self._workers
        pace = pace_of(self._samples) if measured else None
        left = len(self._left)
        self._planned, self._last = next_packs(left, self._workers, self._last, pace)

    def put_back(self, runs: Sequence[Run]) -> None:
        """Put runs after all others."""
        with self._lock:
            self._left += runs

    def ended(self, run: Run, verdict: Verdict) -> None:
        """Decide nothing."""
        del run, verdict

    def measured(self, sample: PackSample) -> None:
        """Take note of how long a pack took."""
        with self._lock:
            self._samples.append(sample)
