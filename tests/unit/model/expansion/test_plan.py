"""Run ids and packs are a pure function of variants, runs and pack size."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from robovast.model.expansion.variant import ConfigFile, Variant
from robovast.model.plan import pack_runs, plan_runs


def variants(count: int) -> list[Variant]:
    return [Variant(f"v-{n}", "v", {"n": n}) for n in range(count)]


def test_runs_of_a_variant_stay_together() -> None:
    runs = plan_runs(variants(2), 3)
    assert [run.path for run in runs] == ["v-0/0", "v-0/1", "v-0/2", "v-1/0", "v-1/1", "v-1/2"]
    assert [run.id for run in runs] == list(range(6))


@given(st.integers(0, 20), st.integers(1, 7), st.integers(1, 50))
def test_every_run_is_in_exactly_one_job(count: int, runs: int, size: int) -> None:
    planned = plan_runs(variants(count), runs)
    jobs = pack_runs(planned, size)
    assert [run for job in jobs for run in job.runs] == planned
    assert len(jobs) == -(-count * runs // size)
    assert [job.name for job in jobs] == [f"job-{n}" for n in range(len(jobs))]


def test_variants_with_different_files_of_one_name_do_not_share_a_job() -> None:
    hall = Variant("hall", "hall", {}, (ConfigFile("map.yaml", Path("/a/map.yaml")),))
    room = Variant("room", "room", {}, (ConfigFile("map.yaml", Path("/b/map.yaml")),))
    jobs = pack_runs(plan_runs([hall, room], 2), 10)
    assert [[run.path for run in job.runs] for job in jobs] == [
        ["hall/0", "hall/1"],
        ["room/0", "room/1"],
    ]


def test_later_jobs_continue_the_numbers() -> None:
    assert [job.name for job in pack_runs(plan_runs(variants(1), 2), 1, first_job=7)] == [
        "job-7",
        "job-8",
    ]
