"""Which part of a job's log is about one of its runs."""

from __future__ import annotations

from collections.abc import Iterator

from robovast.campaign.job_log import has_parts, part_of

LOG = """\
[robovast] job '/out/_jobs/job-0': scenario_execution
before
[robovast] run hall-1/0
first
[robovast] run hall-1/1
second
[robovast] ended with code 0
[robovast] job '/out/_jobs/job-0-2': scenario_execution
[robovast] run hall-1/10
third""".splitlines()


def test_a_run_has_the_lines_up_to_the_next_run_or_the_end_of_its_job() -> None:
    parts = [list(part_of(LOG, f"hall-1/{number}"))[1:] for number in (0, 1, 10)]
    assert parts == [["first"], ["second"], ["third"]]


def test_a_log_that_does_not_name_the_run_has_no_part_of_it() -> None:
    assert list(part_of(LOG, "hall-1/2")) == []
    assert list(part_of(["no", "marks"], "hall-1/0")) == []


def test_whether_a_log_has_parts_is_known_once_a_run_has_begun() -> None:
    executing = "[INFO] [1.0] [scenario_execution]: Executing scenario 'drive'"
    assert has_parts(LOG[:2]) is None
    assert has_parts([*LOG[:3], executing]) is True
    assert has_parts([*LOG[:2], executing, LOG[2]]) is False


def test_nothing_after_the_part_is_waited_for() -> None:
    def growing() -> Iterator[str]:
        yield from LOG[:5]
        raise AssertionError("the log of another run was read on")

    assert list(part_of(growing(), "hall-1/0"))[1:] == ["first"]
