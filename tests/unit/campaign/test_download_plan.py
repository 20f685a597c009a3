"""What is fetched of a bucket, and what is not."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from robovast.storage.bucket_runs import AT_ONCE, in_batches
from robovast.storage.download_plan import plan_download
from robovast.storage.s3 import StoredObject

TIME = 1_700_000_000.5


def stored(*keys: str) -> list[StoredObject]:
    return [StoredObject(key, 4, TIME, "etag") for key in keys]


def put(folder: Path, key: str, size: int = 4, time: float = TIME) -> None:
    path = folder / key
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"x" * size)
    os.utime(path, (time, time))


def test_a_run_is_what_has_a_record(tmp_path: Path) -> None:
    plan = plan_download(
        stored("hall-1/0/bag/a", "hall-1/0/run.json", "hall-1/1/bag/a", "hall-1/_config/c"),
        tmp_path,
    )
    assert [run.path for run in plan.runs] == ["hall-1/0"]
    assert plan.unfinished == ("hall-1/1",)
    assert [file.path for file in plan.files] == ["hall-1/_config/c"]
    assert [item.key for item in plan.runs[0].objects] == ["hall-1/0/bag/a", "hall-1/0/run.json"]


def test_files_below_a_jobs_number_are_no_runs(tmp_path: Path) -> None:
    plan = plan_download(stored("_jobs/0/log", ".x/0/log"), tmp_path)
    assert len(plan.files) == 2
    assert not plan.unfinished


@pytest.mark.parametrize(
    ("size", "time", "here"), [(4, TIME, True), (4, TIME - 5, False), (3, TIME, False)]
)
def test_a_run_is_here_when_its_record_is_that_of_the_bucket(
    tmp_path: Path, size: int, time: float, here: bool
) -> None:
    put(tmp_path, "hall/0/run.json", size, time)
    objects = stored("hall/0/bag", "hall/0/run.json")
    plan = plan_download(objects, tmp_path)
    assert (plan.present, len(plan.runs)) == ((1, 0) if here else (0, 1))
    assert len(plan_download(objects, tmp_path, force=True).runs) == 1


@pytest.mark.parametrize("key", ["../evil", "a//b", ".download/lock"])
def test_an_object_without_a_place_is_told_and_costs_nothing_else(tmp_path: Path, key: str) -> None:
    plan = plan_download(stored(key, "_config/c", "hall/0/run.json"), tmp_path)
    assert [file.path for file in plan.files] == ["_config/c"]
    assert len(plan.runs) == 1
    assert len(plan.warnings) == 1
    assert f"'{key}' is left in the bucket" in plan.warnings[0]


def test_a_file_beside_a_folder_of_its_name_comes_home(tmp_path: Path) -> None:
    plan = plan_download(stored("a", "a/b", "hall", "hall/0/run.json"), tmp_path)
    assert [file.path for file in plan.files] == ["a.1", "a/b", "hall.1"]
    assert [file.item.key for file in plan.files] == ["a", "a/b", "hall"]
    assert [line.partition(" ")[0] for line in plan.warnings] == ["'a'", "'hall'"]
    put(tmp_path, "a.1")
    assert [file.path for file in plan_download(stored("a", "a/b"), tmp_path).files] == ["a/b"]


def test_no_more_runs_are_known_at_once_than_fit_into_memory(tmp_path: Path) -> None:
    place = ".writer-0123456789abcdef"
    keys = [
        f"hall/{n}/{name}" for n in range(5) for name in (f"{place}/a", f"{place}.json", "run.json")
    ]
    plan = plan_download(stored(*keys), tmp_path)
    assert [len(run.objects) for run in plan.runs] == [1] * 5, "what its list will name"
    assert [(run.count, run.size) for run in plan.runs] == [(3, 12)] * 5
    sizes = [
        replace(run, count=count)
        for run, count in zip(plan.runs, (1, AT_ONCE, 9, 1, 2 * AT_ONCE), strict=True)
    ]
    numbers = [[run.path[-1] for run in batch] for batch in in_batches(sizes)]
    assert numbers == [["0"], ["1"], ["2", "3"], ["4"]]
    assert list(in_batches([])) == [[]]
