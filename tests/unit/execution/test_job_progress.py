"""What one job of a pod leaves must say nothing of the runs of the next."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from robovast.execution.progress import PackOutput, keep_the_rest
from robovast.model.expansion import Variant
from robovast.model.plan import Run

ORDINARY = os.getuid() or 1000
"""A user whom modes keep out."""


def take_all(root: Path, modes: dict[str, int]) -> str:
    """What is taken of a run that has given its folders these modes."""
    out, own, stored = root / "out", root / "job-0", root / "stored"
    (out / "a" / "0" / "deep").mkdir(parents=True)
    (out / "rest").touch()
    own.mkdir()
    stored.mkdir()
    (out / "a" / "0" / "test.xml").write_text("verdict")
    for name, mode in modes.items():
        (root / name).chmod(mode)
    run = Run(0, Variant("a", "a", {}), 0)
    taken = PackOutput(out, own, own).take(run, stored)
    keep_the_rest(out, own)
    assert (own / "out" / "rest").is_file()
    (taken / "job").symlink_to("own")
    return (taken / "test.xml").read_text()


@pytest.mark.parametrize("mode", [0, 0o200, 0o555])
def test_a_job_cannot_shut_its_folders_against_who_takes_them(mode: int) -> None:
    """One that did ended the whole campaign."""
    names = ("out/a/0/deep", "out/a/0", "out/a", "out", "job-0")
    with TemporaryDirectory() as root:
        os.chown(root, ORDINARY, -1)
        pool = ProcessPoolExecutor(
            1, get_context("fork"), initializer=os.setuid, initargs=(ORDINARY,)
        )
        with pool:
            taken = pool.submit(take_all, Path(root), dict.fromkeys(names, mode))
            assert taken.result(30) == "verdict"


@pytest.mark.parametrize("wrote", ["", "something"])
def test_runs_that_a_job_never_came_to_have_not_begun_for_the_next(
    tmp_path: Path, wrote: str
) -> None:
    """A job that is stopped may have made the folders of all its runs."""
    out, own = tmp_path / "out", tmp_path / "job-0"
    runs = [Run(number, Variant("a", "a", {}), number) for number in range(3)]
    own.mkdir()
    for run in runs:
        (out / run.path / "deep").mkdir(parents=True)
        if wrote:
            (out / run.path / "deep" / wrote).touch()
    keep_the_rest(out, own)
    following = PackOutput(out, out / "_jobs" / "job-0-2", out)
    assert not any(following.has_begun(run) for run in runs)
    assert not following.is_over(runs[0])
