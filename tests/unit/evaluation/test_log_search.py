"""A text is found in the logs of many runs, in each run's own lines alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.campaigns.stored import NAME, START, write, write_campaign

from robovast.evaluation.log_search import MOST_RUNS, search_logs


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return write_campaign(tmp_path.resolve(), runs=2)


def runs_found(root: Path, text: str, *runs: str) -> list[str]:
    return [found.run for found in search_logs(root.parent, NAME, runs, text)]


def test_runs_are_found_by_a_text_in_their_log(root: Path) -> None:
    write(root / "_jobs" / "job-2" / "logs" / "system.log", "\x1b[31mSen\x1b[0msor lost\n" * 5)
    (found,) = search_logs(root.parent, NAME, ["hall-1/0", "hall-2/0"], "sensor LOST")
    assert (found.run, found.matches, len(found.lines)) == ("hall-2/0", 5, 3)
    assert found.path == f"{NAME}/_jobs/job-2/logs/system.log"


def test_of_a_log_of_several_runs_only_its_own_lines_count(root: Path) -> None:
    job = root / "_jobs" / "job-0"
    write(job / "finished_runs", "0\n1\n")
    write(job / "logs" / "system.log", f"[INFO] [{START + 1:.3f}] [a]: lost\n")
    second = root / "hall-1" / "1"
    record = (second / "run.json").read_text().replace("job-1", "job-0")
    write(second / "run.json", record)
    assert runs_found(root, "lost", "hall-1/0", "hall-1/1") == ["hall-1/0"]


def test_nothing_is_found_of_runs_that_are_gone_or_elsewhere(root: Path) -> None:
    write(root.parent.parent / "system.log", "sensor lost\n")
    assert runs_found(root, "sensor", "hall-1/7", "../..", "hall-1/0") == []
    assert runs_found(root, " ", "hall-1/0") == []


def test_an_answer_is_bounded(root: Path) -> None:
    runs = ["hall-1/0"] * (MOST_RUNS + 1)
    assert len(runs_found(root, "goal not reached", *runs)) == MOST_RUNS


def test_sequences_that_do_not_end_hide_nothing_and_take_no_time(root: Path) -> None:
    title = "\x1b]0;robot\x1b\\"
    log = f"{title}goal lost\n\x1b]goal lost\nbell\x07\n" + "\x1b]" * (1 << 20)
    write(root / "_jobs" / "job-0" / "logs" / "system.log", log)
    (found,) = search_logs(root.parent, NAME, ["hall-1/0"], "goal lost")
    assert [line.text for line in found.lines] == ["goal lost", "]goal lost"]
