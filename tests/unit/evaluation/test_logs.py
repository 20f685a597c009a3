"""A log is read a page at a time, and every line has the level it was said at."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from robovast.evaluation.logs import LONGEST_LINE, PAGE, PART, LogQuestion, parse_lines, read_log


@pytest.mark.parametrize(
    ("line", "level"),
    [
        ("[INFO] [1795246823.364775] [node]: fine", "info"),
        ("[node-1] [WARN] [1795246823.3] slow", "warn"),
        ("WARNING: deprecated", "warn"),
        ("2026-03-04 13:24:44 ERROR: broken", "error"),
        ("[FATAL] [1.2] [node]: gone", "fatal"),
        ("CRITICAL | gone", "fatal"),
        ("\x1b[31m[ERROR] [1.2] red\x1b[0m", "error"),
        ("no error here", ""),
        ("[ERROR] [12.5] [scenario_execution]: [INFO] [12.4] [follower]: a way of 5.3 m", "info"),
        ("[INFO] [12.5] [scenario_execution]: \x1b[31m[ERROR] [12.4] [a]: no\x1b[0m", "error"),
    ],
)
def test_levels(line: str, level: str) -> None:
    (found,) = parse_lines([line])
    assert found.level == level


def test_a_traceback_is_an_error_to_its_last_line() -> None:
    lines = ["Traceback (most recent call last):", "  File", "ValueError: no", "[robovast] on"]
    assert [line.level for line in parse_lines(lines)] == ["error", "error", "error", ""]


def test_control_characters_are_taken_out() -> None:
    (line,) = parse_lines(["a\x1b[1;31mb\x1b]0;title\x07c\x00\x08d\te"])
    assert line.text == "abcd\te"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    lines = [f"[INFO] [{1000000000 + i}.000] [n]: line {i}" for i in range(3 * PAGE)]
    lines[4] = "[ERROR] [1000000004.000] [n]: Goal missed"
    (tmp_path / "log").write_text("\n".join(lines))
    return tmp_path


def test_the_end_comes_first_then_the_page_before(log: Path) -> None:
    last = read_log(log, "log", LogQuestion())
    assert (last.total, last.lines[-1].text[-9:]) == (3 * PAGE, f"line {3 * PAGE - 1}")
    before = read_log(log, "log", LogQuestion(before=last.lines[0].number))
    assert before.lines[-1].number == last.lines[0].number - 1


def test_a_search_goes_through_the_whole_file(log: Path) -> None:
    found = read_log(log, "log", LogQuestion(text="goal MISSED"))
    assert (found.matches, [line.number for line in found.lines]) == (1, [5])


def test_only_the_lines_of_a_level(log: Path) -> None:
    found = read_log(log, "log", LogQuestion(levels=frozenset({"error", "fatal"})))
    assert [line.number for line in found.lines] == [5]
    assert (found.counts["error"], found.counts["info"]) == (1, 3 * PAGE - 1)


def test_only_the_lines_of_a_period(log: Path) -> None:
    found = read_log(log, "log", LogQuestion(since=1000000003.5, until=1000000006.5))
    assert [line.number for line in found.lines] == [5, 6, 7]


def test_a_line_without_an_end_is_cut(tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(b"x" * 1_000_000 + b"\n\xff\xfe broken\n")
    found = read_log(tmp_path, "log", LogQuestion())
    assert [len(line.text) for line in found.lines] == [LONGEST_LINE, 9]


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of three parts and a bit, a line for each millisecond."""
    folder = tmp_path_factory.mktemp("large")
    with (folder / "log").open("w") as file:
        file.writelines(
            f"[INFO] [{1000000000 + i / 1000:.3f}] [n]: line {i:07} {'.' * 60}\n"
            for i in range(3 * PART // 105 + 20_000)
        )
    return folder


def test_of_a_large_log_the_last_part_is_read_then_the_part_before(large: Path) -> None:
    last = read_log(large, "log", LogQuestion())
    assert last.begin > 0
    assert last.end == last.size == (large / "log").stat().st_size
    before = read_log(large, "log", LogQuestion(end=last.begin))
    assert (before.begin, before.end) == (last.begin - PART, last.begin)
    assert {len(line.text) for line in before.lines} == {len(last.lines[0].text)}, "whole lines"


def test_every_line_is_in_one_part(large: Path) -> None:
    total, end = 0, None
    while end != 0:
        part = read_log(large, "log", LogQuestion(end=end))
        total, end = total + part.total, part.begin
    assert total == 3 * PART // 105 + 20_000


def test_in_a_large_log_the_lines_of_a_period_are_found(large: Path) -> None:
    period = LogQuestion(since=1000000003.5, until=1000000003.502)
    found = read_log(large, "log", period)
    assert [line.text[29:41] for line in found.lines] == [f"line {i:07}" for i in range(3500, 3503)]


def test_a_log_of_any_size_costs_no_more_than_a_part(tmp_path: Path) -> None:
    with (tmp_path / "log").open("wb") as file:
        file.truncate(1 << 40)
        file.seek(0, 2)
        file.write(b"\n[ERROR] [1000000000.000] [n]: the end\n")
    began = time.process_time()
    found = read_log(tmp_path, "log", LogQuestion(levels=frozenset({"error"})))
    assert [line.text[-7:] for line in found.lines] == ["the end"]
    read_log(tmp_path, "log", LogQuestion(since=1.0, until=2.0))
    assert time.process_time() - began < 10, "seconds"


@pytest.mark.parametrize(
    ("lines", "first"),
    [
        (["[INFO] [1.0] [n]: fine", "[ERROR] [2.0] [n]: no", "[ERROR] [3.0] [n]: later"], 2),
        (
            [
                "[ERROR] [1.0] [scenario_execution]: loading",
                "[ERROR] [2.0] [scenario_execution]: [INFO] [1.9] [follower]: a way of 5.3 m",
                "[ERROR] [3.0] [scenario_execution]: [ERROR] [2.9] [simulator]: collision",
            ],
            3,
        ),
        (["[ERROR] [1.0] [scenario_execution]: Traceback (most recent call last):"], 1),
        (["fine", "Traceback (most recent call last):", "ValueError: no"], 2),
        (["fine", "[ERROR] [1.0] [scenario_execution]: execution failed."], 2),
        (
            [
                "[INFO] [1.0] [scenario_execution]: Cancel requested, sending SIGTERM",
                "[ERROR] [1.1] [scenario_execution]: drive: execution failed. -^- drive [✕]",
                "[ERROR] [2.0] [scenario_execution]: [FATAL] [1.9] [simulator]: it was stopped",
            ],
            2,
        ),
        (
            [
                "[ERROR] [1.0] [scenario_execution]: [INFO] [0.9] [follower]: a way of 5.3 m",
                "[ERROR] [1.1] [scenario_execution]: Fatal Python error: Segmentation fault",
                "[ERROR] [1.2] [scenario_execution]: drive: execution failed. -^- drive [✕]",
            ],
            2,
        ),
        (["[INFO] [1.0] [n]: no error here"], None),
    ],
)
def test_the_first_error_is_one_that_a_program_calls_so(
    tmp_path: Path, lines: list[str], first: int | None
) -> None:
    (tmp_path / "log").write_text("\n".join(lines))
    assert read_log(tmp_path, "log", LogQuestion(text="nowhere")).error == first
