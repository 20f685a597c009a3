"""What one job of a pod leaves must say nothing of the runs of the next."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.execution.progress import JobOutput, keep_the_rest
from robovast.model.expansion import Variant
from robovast.model.plan import Run


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
    following = JobOutput(out, out / "_jobs" / "job-0-2", out)
    assert not any(following.has_begun(run) for run in runs)
    assert not following.is_over(runs, 0)
