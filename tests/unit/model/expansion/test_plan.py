"""Run ids and packs are a pure function of variants, runs and pack size."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.errors import InputError
from robovast.model.plan import PackStart, pack_runs, plan_runs, plan_variants
from robovast.model.variant import ConfigFile, Variant


def variants(count: int) -> list[Variant]:
    return [Variant(f"v-{n}", "v", {"n": n}) for n in range(count)]


def test_runs_of_a_variant_stay_together() -> None:
    two = variants(2)
    runs = plan_runs(plan_variants(two, 3), two)
    assert [run.path for run in runs] == ["v-0/0", "v-0/1", "v-0/2", "v-1/0", "v-1/1", "v-1/2"]
    assert [run.id for run in runs] == list(range(6))


def packed(some: list[Variant], runs: int, size: int, first_job: int = 0) -> list[PackStart]:
    plan = plan_variants(some, runs, size)
    return pack_runs(plan, plan_runs(plan, some), first_job)


@given(st.integers(0, 20), st.integers(1, 7), st.integers(1, 50), st.data())
def test_every_run_is_in_exactly_one_job(
    count: int, runs: int, size: int, data: st.DataObject
) -> None:
    """What is left of a plan fills its jobs as all of it does."""
    plan = plan_variants(variants(count), runs, size)
    every = plan_runs(plan, variants(count))
    left = [run for run in every if data.draw(st.booleans())]
    jobs = pack_runs(plan, left)
    assert [run for job in jobs for run in job.runs] == left
    assert len(jobs) == -(-len(left) // size)
    assert [job.name for job in jobs] == [f"job-{n}" for n in range(len(jobs))]


def test_variants_with_different_files_of_one_name_do_not_share_a_job() -> None:
    hall = Variant("hall", "hall", {}, (ConfigFile("map.yaml", Path("/a/map.yaml")),))
    room = Variant("room", "room", {}, (ConfigFile("map.yaml", Path("/b/map.yaml")),))
    jobs = packed([hall, room], 2, 10)
    assert [[run.path for run in job.runs] for job in jobs] == [
        ["hall/0", "hall/1"],
        ["room/0", "room/1"],
    ]


def test_later_jobs_continue_the_numbers() -> None:
    assert [job.name for job in packed(variants(1), 2, 1, first_job=7)] == ["job-7", "job-8"]


def test_more_runs_than_any_cluster_could_execute_are_a_mistake() -> None:
    with pytest.raises(InputError, match=r"would have 20,000,000 runs, more than 10,000,000"):
        plan_variants(variants(2), 10_000_000)


def test_more_runs_of_some_variants_come_after_all_others() -> None:
    few = variants(3)
    plan = plan_variants(few, 2, 2, {few[1].name: 5, few[2].name: 1})
    before = plan_variants(few, 2, 2)
    runs = plan_runs(plan, few, 7)
    assert runs[: before.total] == plan_runs(before, few, 7)
    assert [run.path for run in runs[before.total :]] == [f"{few[1].name}/{n}" for n in (2, 3, 4)]
