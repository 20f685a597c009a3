"""How many runs share a start, where that is measured."""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable
from dataclasses import dataclass

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robovast.model.packing import MOST, WAIT, Pace, PackSample, next_packs, pace_of
from robovast.model.packs import Block, PlanSpec, Round

seconds = st.floats(0, 1e6)


@given(
    st.integers(1, 10**7),
    st.integers(1, 10_000),
    st.integers(0, MOST),
    st.none() | st.builds(Pace, seconds, seconds),
)
def test_every_round_has_runs_and_leaves_the_others(
    left: int, workers: int, last: int, pace: Pace | None
) -> None:
    runs, size = next_packs(left, workers, last, pace)
    assert 1 <= runs <= left
    assert 1 <= size <= MOST


@given(st.integers(1, 10**7), st.integers(1, 10_000), st.floats(0, 1e4), st.floats(1e-3, 1e4))
def test_a_campaign_needs_few_rounds(total: int, workers: int, start: float, run: float) -> None:
    """Each is a plan in a ConfigMap and a Job or more."""
    left, last, rounds = total, 0, 0
    while left:
        runs, last = next_packs(left, workers, last, Pace(start, run))
        left, rounds = left - runs, rounds + 1
    assert rounds <= 10 + 2 * max(1, total // workers).bit_length()


@given(st.integers(1, 10**6), st.integers(1, 1000), st.floats(0, 100), st.floats(0.01, 100))
def test_no_pack_keeps_the_others_waiting(
    left: int, workers: int, start: float, run: float
) -> None:
    """Unless that is no longer than a few starts."""
    runs, size = next_packs(left, workers, 100, Pace(start, run))
    fair = -(-left // workers)
    assert size <= max(1, fair)
    assert size <= -(-left // (2 * workers)) or (size - 1) * run <= WAIT * start or runs == left


def test_few_short_runs_are_not_cut_so_small_that_starts_take_most_of_the_time() -> None:
    found = simulated(200, 4, 11, lambda: 1.25)
    assert found.sizes == [1, 16, 33]
    assert found.took < 4 * 11 + found.ideal


@given(st.integers(1, 1000), st.integers(1, 1000))
def test_runs_that_take_long_are_not_packed(left: int, workers: int) -> None:
    assert next_packs(left, workers, 1, Pace(start=5, run=300)) == (left, 1)


def test_the_first_packs_are_small_and_the_next_ones_grow() -> None:
    assert next_packs(10_000, 10, 0, None) == (10, 1)
    assert next_packs(9_990, 10, 1, Pace(10, 1)) == (160, 16)
    assert next_packs(9_830, 10, 16, Pace(10, 1))[1] == 256
    assert next_packs(900, 10, 256, Pace(10, 1))[1] == 45
    assert next_packs(400, 10, 45, Pace(10, 1)) == (400, 40)


def test_a_pace_needs_runs_and_is_not_spoilt_by_one_pod_that_waited() -> None:
    assert pace_of([]) is None
    assert pace_of([PackSample(0, 0, 3)]) is None
    pods = [PackSample(2, 4, 7), PackSample(1, 2, 5), PackSample(3, 6, 600)]
    assert pace_of(pods) == Pace(start=3, run=2)


@dataclass
class Outcome:
    """What a simulated campaign took."""

    took: float
    """[s]"""
    ideal: float
    """Its runs alone, evenly on all workers [s]."""
    starts: float
    """Part of all time that went into starts."""
    sizes: list[int]


def simulated(runs: int, workers: int, start: float, duration: Callable[[], float]) -> Outcome:
    """A campaign whose rounds are planned as the operator plans them."""
    times = [duration() for _ in range(runs)]
    work, begun, packs, now = sum(times), 0, 0, 0.0
    left, last, sizes, idle = list(times), 0, [], workers
    samples: list[PackSample] = []
    active: list[tuple[float, int, PackSample]] = []
    waiting: list[list[float]] = []
    while True:
        while idle and (waiting or left):
            if not waiting:
                if len(sizes) == 1 and active and 2 * len(samples) < begun:
                    break
                number, last = next_packs(len(left), workers, last, pace_of(samples))
                cut, left = left[:number], left[number:]
                waiting = [cut[at : at + last] for at in range(0, number, last)]
                sizes.append(last)
            pack = waiting.pop(0)
            took = PackSample(len(pack), sum(pack), start + sum(pack))
            heapq.heappush(active, (now + took.seconds, packs, took))
            idle, packs, begun = idle - 1, packs + 1, begun + 1
        if not active:
            break
        now, _, ended = heapq.heappop(active)
        samples.append(ended)
        idle += 1
    return Outcome(now, work / workers, packs * start / (packs * start + work), sizes)


DURATIONS: dict[str, Callable[[random.Random], float]] = {
    "constant": lambda _: 5.0,
    "uniform": lambda dice: dice.uniform(0, 10),
    "exponential": lambda dice: dice.expovariate(0.2),
}


@pytest.mark.parametrize("kind", DURATIONS)
@pytest.mark.parametrize("start", [1, 5])
def test_of_many_runs_starts_cost_less_than_five_percent_and_all_workers_work_to_the_end(
    kind: str, start: int
) -> None:
    dice = random.Random(7)  # noqa: S311
    found = simulated(20_000, 40, start, lambda: DURATIONS[kind](dice))
    assert found.starts < 0.05
    assert found.took < 1.08 * found.ideal
    assert found.sizes[0] == 1
    assert found.sizes[-1] < max(found.sizes)


@given(st.integers(1, 400), st.integers(1, 50), st.floats(0, 30), st.floats(0.1, 100))
def test_packing_is_never_much_slower_than_a_start_for_each_run(
    runs: int, workers: int, start: float, run: float
) -> None:
    """By one start of the round that measures, and one pack at the end that is worth a start."""
    found = simulated(runs, workers, start, lambda: run)
    unpacked = -(-runs // workers) * (start + run)
    assert found.took <= unpacked + 2 * (start + run) + 0.1 * unpacked


@st.composite
def measured_plans(draw: st.DrawFn) -> PlanSpec:
    """Plans of several entries, in whatever rounds, some runs in none yet."""
    sizes = draw(st.lists(st.tuples(st.integers(1, 6), st.integers(1, 6)), min_size=1, max_size=4))
    blocks, variants = [], 0
    for number, runs in sizes:
        blocks.append(Block(first_variant=variants, variants=number, runs=runs))
        variants += number
    cuts = draw(st.sets(st.integers(1, variants)))
    plan = PlanSpec(blocks=tuple(blocks), breaks=",".join(map(str, sorted(cuts))), rounds=())
    rounds: list[Round] = []
    for runs, size in draw(st.lists(st.tuples(st.integers(1, 30), st.integers(1, 9)))):
        left = plan.total - sum(round_.runs for round_ in rounds)
        if left:
            rounds.append(Round(runs=min(runs, left), size=size))
    return PlanSpec(**plan.model_dump(exclude={"rounds"}), rounds=tuple(rounds))


@given(measured_plans())
def test_every_run_of_a_round_is_in_one_pack_and_no_other_is(plan: PlanSpec) -> None:
    packs = [list(plan.pack(number)) for number in range(plan.packs)]
    assert [id_ for pack in packs for id_ in pack] == list(range(plan.in_packs))
    assert all(plan.pack_of(id_) == number for number, pack in enumerate(packs) for id_ in pack)
    assert all(plan.stretch_of(pack[0]) == plan.stretch_of(pack[-1]) for pack in packs)
    for number in range(len(plan.rounds or ())):
        first, last = plan.of_round(number)
        assert plan.pack(plan.pack_of(first))[0] == first
        assert plan.pack(plan.pack_of(last))[-1] == last
    with pytest.raises(IndexError):
        plan.pack_of(plan.in_packs)


@given(measured_plans(), st.integers(1, 9), st.booleans())
def test_a_further_round_leaves_earlier_packs_as_they_were(
    plan: PlanSpec, size: int, more: bool
) -> None:
    assume(plan.rounds is not None)
    given_ = plan.model_dump(exclude={"rounds"})
    if more:
        last = plan.blocks[-1]
        block = Block(first_variant=last.first_variant, variants=1, first_run=100, runs=5)
        given_["blocks"] = (*plan.blocks, block)
    left = plan.total + 5 * more - plan.in_packs
    assume(left)
    longer = PlanSpec(**given_, rounds=(*(plan.rounds or ()), Round(runs=left, size=size)))
    before = [longer.pack(number) for number in range(plan.packs)]
    assert before == [plan.pack(number) for number in range(plan.packs)]
    assert longer.in_packs == longer.total
