"""What a user sees of a running campaign and of its end, and the exit code."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from robovast.base.errors import ExitCode
from robovast.campaign.run_record import RunRecord
from robovast.campaign.verdict import Verdict
from robovast.execution.local.events import ExecutionSummary
from robovast.model.plan import Run
from robovast.model.variant import Variant
from robovast_cli.ui.campaign import MOST_LISTED, exit_code, summary_lines
from robovast_cli.ui.live_view import LiveView, clock_time
from robovast_cli.ui.local_view import LocalView
from robovast_cli.ui.output import echo_verdicts


def runs_of(count: int) -> list[Run]:
    hall = Variant(name="hall", entry="hall", parameters={})
    return [Run(number, hall, number) for number in range(count)]


def record(run: Run, verdict: Verdict = Verdict.PASSED, reason: str = "") -> RunRecord:
    return RunRecord(
        campaign="c", variant=run.variant.name, entry=run.variant.entry, run=run.number, id=run.id,
        verdict=verdict, reason=reason, started_at="", finished_at="", duration=1.5, exit_code=0,
        attempt=1, job=f"job-{run.id}", runtime="process", image="", image_digest="", host="h",
    )  # fmt: skip


def summary(
    *verdicts: Verdict, total: int | None = None, interrupted: bool = False
) -> ExecutionSummary:
    runs = runs_of(len(verdicts))
    records = [record(r, v, "because") for r, v in zip(runs, verdicts, strict=True)]
    return ExecutionSummary(Path("out/c"), total or len(verdicts), records, interrupted)


P, F, E = Verdict.PASSED, Verdict.FAILED, Verdict.ERRORED


@pytest.mark.parametrize(
    ("ended", "code"),
    [
        (summary(P, P), ExitCode.OK),
        (summary(P, F, E), ExitCode.TEST_FAILED),
        (summary(P, E), ExitCode.RUN_ERRORED),
        (summary(P, total=3), ExitCode.RUN_ERRORED),
        (summary(P, F, interrupted=True), ExitCode.INTERRUPTED),
    ],
)
def test_the_exit_code_follows_from_the_verdicts(ended: ExecutionSummary, code: ExitCode) -> None:
    assert exit_code(ended) is code


def failed(*reasons: str, verdict: Verdict = F) -> list[RunRecord]:
    return [record(run, verdict, why) for run, why in zip(runs_of(1000), reasons, strict=False)]


def test_the_summary_has_one_line_for_each_cause() -> None:
    records = failed(*["share below 0.9"] * 30, "KeyError: 'a'")
    assert list(summary_lines(ExecutionSummary(Path("out/c"), 31, records, False))) == [
        "",
        "failed    30 × share below 0.9  hall/0 … (out/c/_jobs/job-0/logs/system.log)",
        "failed     1 × KeyError: 'a'  hall/30 (out/c/_jobs/job-30/logs/system.log)",
        "",
        "31 runs: 31 failed.",
        "Results: out/c",
    ]


def test_a_module_that_plain_processes_lack_is_told_with_the_remedy() -> None:
    records = failed("run_process: ModuleNotFoundError: No module named 'rclpy'", "collision")
    lines = list(summary_lines(ExecutionSummary(Path("out/c"), 2, records, False)))
    (remedy,) = [line for line in lines if "ROBOVAST_PROCESS_ENV" in line]
    assert "export ROBOVAST_PROCESS_ENV=$(scripts/ros-environment)" in remedy
    lines = list(summary_lines(ExecutionSummary(Path("out/c"), 1, failed("collision"), False)))
    assert not any("ROBOVAST_PROCESS_ENV" in line for line in lines)


def test_a_campaign_whose_runs_only_follow_does_not_begin_with_none(capsys) -> None:
    LocalView().campaign_started(Path("out/c"), 0, 0, "process, 2 side by side")
    assert capsys.readouterr().out == "process, 2 side by side, into out/c\n"


def test_crashes_and_timeouts_are_never_among_the_causes_that_are_left_out() -> None:
    words = [f"{a}{b}" for a in "abcdefghij" for b in "abcde"]
    records = failed(*words) + failed("stopped after 6 s", verdict=E)
    lines = list(summary_lines(ExecutionSummary(Path("out/c"), 51, records, False)))
    assert sum(line.startswith("failed ") for line in lines) == MOST_LISTED - 1
    assert sum(line.startswith("errored") for line in lines) == 1
    assert "… and 31 more causes: 31 failed." in lines


def test_verdicts_have_colours_on_a_terminal_alone(monkeypatch, capsys) -> None:
    for line in ("failed     3 × 0 failed tests", "4 runs: 1 passed, 3 failed."):
        echo_verdicts(line)
    assert "\x1b" not in capsys.readouterr().out
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    echo_verdicts("failed     3 × 0 failed tests")
    echo_verdicts("4 runs: 1 passed, 3 failed.")
    assert capsys.readouterr().out.splitlines() == [
        "\x1b[31mfailed\x1b[0m     3 × 0 failed tests",
        "4 runs: \x1b[32m1 passed\x1b[0m, \x1b[31m3 failed\x1b[0m.",
    ]
    monkeypatch.setenv("NO_COLOR", "1")
    echo_verdicts("4 runs: 1 passed.")
    assert "\x1b" not in capsys.readouterr().out


def test_an_unfinished_campaign_says_how_to_go_on() -> None:
    lines = list(summary_lines(summary(P, total=4, interrupted=True)))
    assert lines[1:] == [
        "4 runs: 1 passed, 3 not started.",
        "Results: out/c",
        "Continue: vast exec local run --resume out/c",
    ]
    spaced = replace(summary(P, total=4), campaign=Path("my results/c"))
    assert list(summary_lines(spaced))[-1] == (
        "Continue: vast exec local run --resume 'my results/c'"
    )


def play(view: LocalView, runs: list[Run], verdicts: list[Verdict], done: int = 0) -> None:
    view.campaign_started(Path("out/c"), len(runs) + done, done, "process, 2 side by side")
    for run, verdict in zip(runs, verdicts, strict=True):
        view.run_started(run)
        view.run_finished(run, record(run, verdict, "" if verdict is P else "because"))


def test_a_short_campaign_has_a_line_for_each_run(capsys) -> None:
    play(LocalView(), runs_of(3), [P, F, P])
    assert capsys.readouterr().out.splitlines() == [
        "3 runs, process, 2 side by side, into out/c",
        "[1/3] passed  hall/0  1.5 s",
        "[2/3] failed  hall/1: because",
        "[3/3] passed  hall/2  1.5 s",
    ]


def test_a_long_campaign_has_a_hundred_lines_and_the_failures(capsys) -> None:
    verdicts = [P] * 10_000
    verdicts[1234] = F
    play(LocalView(), runs_of(10_000), verdicts)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 102
    assert "[ 1235/10000] failed  hall/1234: because" in lines


def test_a_cause_has_a_line_when_it_appears_first(capsys) -> None:
    play(LocalView(), runs_of(200), [F] * 200)
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if "because" in line] == ["[  1/200] failed  hall/0: because"]


def test_the_counts_come_last(capsys) -> None:
    verdicts = [P] * 10_000
    verdicts[1234] = F
    play(LocalView(), runs_of(10_000), verdicts)
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "10000 of 10000 done: 9999 passed, 1 failed"


def test_a_resumed_campaign_counts_what_was_there(capsys) -> None:
    play(LocalView(), runs_of(1), [P], done=3)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("4 runs, 3 already finished, ")
    assert lines[1].startswith("[4/4] ")


def test_the_time_left_follows_from_the_pace() -> None:
    now = 100.0
    progress = LocalView(clock=lambda: now)
    runs = runs_of(10)
    progress.campaign_started(Path("c"), 12, 2, "docker")
    assert progress.left is None
    now = 120.0
    progress.run_finished(runs[0], record(runs[0]))
    progress.run_finished(runs[1], record(runs[1]))
    assert progress.left == pytest.approx(80.0)
    assert clock_time(80) == "1:20"
    assert clock_time(3723) == "1:02:03"


@pytest.mark.parametrize("width", [100, 60])
def test_the_live_view_shows_counts_and_what_runs(width: int) -> None:
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=width, color_system=None)
    runs = runs_of(20)
    with LocalView(lambda look: LiveView(look, console=console)) as view:
        view.campaign_started(Path("c"), 20, 0, "docker, 12 side by side")
        for run in runs[:12]:
            view.run_started(run)
        view.run_finished(runs[0], record(runs[0]))
        view.run_finished(runs[1], record(runs[1], E, "[red]exploded"))
    *_, bar, running = (line for line in screen.getvalue().splitlines() if line.strip("\x1b[?25h"))
    assert re.search(r"2/20 1 passed  1 errored 0:00, about 0:0\d left", bar)
    assert "running: hall/2, hall/3, hall/4, hall/5, hall/6" in running
    assert (width == 60) == running.rstrip().endswith("…")
    assert "hall/9 and 2 more" in running or width == 60


def test_what_did_not_pass_stays_above_the_live_view() -> None:
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=100, color_system=None)
    with LocalView(lambda look: LiveView(look, console=console)) as view:
        play(view, runs_of(2), [P, E])
    assert "errored hall/1: because" in screen.getvalue()
    assert "passed  hall/0" not in screen.getvalue()
