"""Whatever ends first and whatever dies, the same runs are needed, and the same is decided."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robovast.base.sequential import Decision, SequentialTest
from robovast.campaign.decisions import decide
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.execution.local.pack_queue import DecidingQueue, decisions_of
from robovast.model.expansion import Variant
from robovast.model.plan import PackStart, Run

TEST = SequentialTest(0.05, 0.2, 0.05, least=3, most=30)
RATES = (0.0, 1.0, 0.12, 0.3)


@dataclass(frozen=True)
class _Record:
    verdict: Verdict


def planned() -> list[Run]:
    """All runs of four configurations."""
    variants = [Variant(f"v-{n}", "v", {}) for n in range(len(RATES))]
    return [
        Run(30 * place + number, variant, number)
        for place, variant in enumerate(variants)
        for number in range(30)
    ]


def verdict_of(seed: int, run: Run) -> Verdict:
    """What a run's seed makes of it."""
    rng = random.Random(f"{seed}/{run.path}")  # noqa: S311
    if rng.random() < 0.05:
        return Verdict.ERRORED
    rate = RATES[int(run.variant.name[2:])]
    return Verdict.FAILED if rng.random() < rate else Verdict.PASSED


def truth(seed: int) -> dict[str, Decision]:
    """The decisions by all verdicts there could be."""
    found: dict[str, dict[int, Verdict]] = {}
    for run in planned():
        found.setdefault(run.variant.name, {})[run.number] = verdict_of(seed, run)
    return {name: decide(TEST, verdicts) for name, verdicts in found.items()}


def execute(
    seed: int, workers: int, per_job: int, rng: random.Random, stored: dict[int, Any], dies: int
) -> bool:
    """A session that may die after so many runs; returns whether it came to its end."""
    queue = DecidingQueue(TEST, planned(), stored, 0, per_job)
    under_way: list[tuple[PackStart, int]] = []
    while True:
        while len(under_way) < workers and (pack := queue.take()) is not None:
            under_way.append((pack, 0))
        if not under_way:
            return True
        if dies == 0:
            return False
        pack, done = under_way.pop(rng.randrange(len(under_way)))
        run = pack.runs[done]
        assert run.id not in stored
        stored[run.id] = _Record(verdict_of(seed, run))
        queue.ended(run, stored[run.id].verdict)
        if rng.random() < 0.1:
            queue.put_back(pack.runs[done + 1 :])
        elif done + 1 < len(pack.runs):
            under_way.append((pack, done + 1))
        dies -= 1


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(1, 5), st.integers(0, 10**6))
def test_deaths_and_orders_change_nothing(
    seed: int, workers: int, per_job: int, chance: int
) -> None:
    rng, stored = random.Random(chance), {}  # noqa: S311
    while not execute(seed, workers, per_job, rng, stored, rng.randrange(60)):
        pass
    records = cast("dict[int, RunRecord]", stored)
    known = {one.variant: one.decision for one in decisions_of(TEST, planned(), records)}
    right = truth(seed)
    assert known == right
    counted = {run.id for run in planned() if run.number < right[run.variant.name].runs}
    assert counted <= stored.keys()


@pytest.mark.parametrize("workers", [1, 4])
def test_a_worker_runs_ahead_only_while_all_that_is_needed_is_under_way(workers: int) -> None:
    stored: dict[int, Any] = {}
    assert execute(3, workers, 1, random.Random(1), stored, -1)  # noqa: S311
    needed = sum(decision.runs for decision in truth(3).values())
    assert needed <= len(stored) <= needed + (workers - 1) * len(RATES)
    if workers == 1:
        assert len(stored) == needed
