"""Packs of a local campaign that grow by what runs take."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from robovast.execution.local.measured_queue import MeasuredQueue
from robovast.model.expansion import Variant
from robovast.model.packing import PackSample
from robovast.model.packs import Block, PlanSpec
from robovast.model.plan import Run, plan_runs


def queue_of(variants: int, workers: int, breaks: str = "") -> tuple[MeasuredQueue, list[Run]]:
    plan = PlanSpec(blocks=(Block(first_variant=0, variants=variants, runs=10),), breaks=breaks)
    runs = plan_runs(plan, [Variant(f"v-{n}", "v", {}) for n in range(variants)])
    return MeasuredQueue(plan, runs, 1, workers), runs


@given(
    st.integers(1, 9), st.integers(1, 5), st.sampled_from(["", "1", "2-3"]), st.floats(0, 9),
    st.floats(0.01, 9), st.integers(0, 3),
)  # fmt: skip
def test_every_run_is_handed_out_once_unless_it_is_put_back(
    variants: int, workers: int, breaks: str, start: float, run: float, lost: int
) -> None:
    queue, runs = queue_of(variants, workers, breaks)
    done: list[int] = []
    jobs = []
    while pack := queue.take():
        jobs.append(pack.index)
        back = pack.runs[1:] if lost > 0 else ()
        lost -= 1
        mine = pack.runs[: len(pack.runs) - len(back)]
        done += [one.id for one in mine]
        queue.measured(PackSample(len(mine), run * len(mine), start + run * len(mine)))
        queue.put_back(back)
    assert sorted(done) == [one.id for one in runs]
    assert len(set(jobs)) == len(jobs)


def test_packs_grow_with_what_is_measured_and_shrink_at_the_end() -> None:
    queue, _ = queue_of(100, 2)
    sizes = []
    while pack := queue.take():
        sizes.append(len(pack.runs))
        queue.measured(PackSample(sizes[-1], sizes[-1] * 1.0, 10 + sizes[-1] * 1.0))
    assert sizes[:4] == [1, 1, 16, 16]
    assert max(sizes) > 100
    assert sizes[-1] <= 60, "six starts"
    assert len(sizes) < 30


def test_long_runs_are_not_packed_and_configurations_whose_files_differ_never() -> None:
    queue, runs = queue_of(3, 2)
    while pack := queue.take():
        assert len(pack.runs) == 1
        queue.measured(PackSample(1, 300, 301))
    queue, runs = queue_of(3, 1, breaks="1-2")
    while pack := queue.take():
        assert len({run.variant.name for run in pack.runs}) == 1
        queue.measured(PackSample(len(pack.runs), 0.1, 10))
    assert len(runs) == 30
