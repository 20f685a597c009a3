"""A job is watched in the same way wherever it is executed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from robovast.base.stopwatch import Stopwatch
from robovast.campaign.judge import Ending
from robovast.campaign.layout import SYSTEM_LOG
from robovast.campaign.records import EndedRun
from robovast.campaign.verdict import Verdict
from robovast.execution.progress import FINISHED_RUNS, PackOutput
from robovast.execution.watch import PackWatch, final_ending
from robovast.model.expansion import Variant
from robovast.model.plan import PackStart, Run

RUNS = tuple(Run(number, Variant("v", "v", {}), number) for number in range(3))


class Scripted:
    """A process that does one thing between two looks, and then ends."""

    def __init__(self, *steps: Callable[[], None]) -> None:
        self._steps = list(steps)
        self.interrupted = False
        self.stopped = False
        self.seconds = 0.0

    def started(self) -> Stopwatch:
        return Stopwatch(late=self.seconds)

    def ending(self) -> Ending | None:
        return None if self._steps else Ending(0)

    def is_interrupted(self) -> bool:
        return self.interrupted

    def stop(self) -> int:
        self.stopped = True
        return 143

    def wait(self, seconds: float) -> None:
        del seconds
        self._steps.pop(0)()


class Place:
    """Where a job writes, and what was handed over of it."""

    def __init__(self, root: Path) -> None:
        self.out, self.own, self.stored = root / "out", root / "own", root / "stored"
        self.out.mkdir()
        self.own.mkdir()
        self.over: list[EndedRun] = []

    def watch(self, process: Scripted, timeout: int | None = None) -> PackWatch:
        output = PackOutput(self.out, self.own, self.own)
        return PackWatch(
            process, PackStart(0, RUNS), output, self.stored, timeout, self.over.append
        )

    def writes(self, number: int, failed: bool = False, said: bool = True) -> None:
        folder = self.out / RUNS[number].path
        folder.mkdir(parents=True)
        case = "<testcase><failure/></testcase>" if failed else "<testcase/>"
        (folder / "test.xml").write_text(f"<testsuite>{case}</testsuite>")
        with (self.own / FINISHED_RUNS).open("a") as file:
            file.write(f"{RUNS[number].path}\n" if said else "")

    def verdicts(self) -> list[tuple[int, Verdict]]:
        return [(ended.run.id, ended.result.verdict) for ended in self.over]


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path)


def test_runs_are_handed_over_while_the_job_goes_on(place: Place) -> None:
    seen: list[int] = []
    process = Scripted(
        lambda: place.writes(0),
        lambda: seen.append(len(place.over)),
        lambda: (place.writes(1), place.writes(2, failed=True))[0],
    )
    watch = place.watch(process)
    ending = watch.follow()
    assert seen == [1]
    assert place.verdicts() == [(0, Verdict.PASSED), (1, Verdict.PASSED)], "one look shows both"
    last = watch.finish(ending)
    assert last is not None
    assert last.result.verdict is Verdict.FAILED
    assert last.folder.is_relative_to(place.stored)
    assert (last.exit_code, watch.left) == (0, ())


def test_the_reason_of_a_run_is_not_what_the_next_one_floods_the_log_with(place: Place) -> None:
    """Its own beginning was written before the run ahead of it was noticed to be finished."""
    log = place.own / SYSTEM_LOG
    log.parent.mkdir(parents=True)
    costmap = "[ERROR] costmap timed out\n" * 12_000

    def begin(number: int, said: str) -> None:
        with log.open("a") as file:
            file.write(f"[robovast] run {RUNS[number].path}\n{said}")

    def first() -> None:
        begin(0, costmap)
        place.writes(0)
        begin(1, "[ERROR] grasp lost\n")

    def second() -> None:
        place.writes(1, failed=True)
        begin(2, costmap)

    place.watch(Scripted(first, second)).follow()
    assert place.over[1].result.reason == "the scenario failed; grasp lost"


def test_a_folder_of_a_later_run_ends_none(place: Place) -> None:
    """Any run can make one, by mistake."""

    def make_folders() -> None:
        for run in RUNS[1:]:
            (place.out / run.path).mkdir(parents=True)

    watch = place.watch(Scripted(make_folders, lambda: None))
    watch.follow()
    assert place.verdicts() == []


def test_without_a_word_runs_are_over_at_the_end_of_their_job(place: Place) -> None:
    """Where the driver cannot be used, results are written at the end."""
    process = Scripted(
        lambda: place.writes(0, said=False), lambda: place.writes(1, failed=True, said=False)
    )
    watch = place.watch(process)
    last = watch.finish(watch.follow())
    assert place.verdicts() == [(0, Verdict.PASSED), (1, Verdict.FAILED)]
    assert (last, watch.left) == (None, RUNS[2:])


def test_what_an_interruption_made_of_a_run_does_not_count(place: Place) -> None:
    """A run that is told to end may say that it has failed."""

    def interrupt() -> None:
        process.interrupted = True
        place.writes(0)
        place.writes(1, failed=True)

    process = Scripted(interrupt, lambda: None)
    watch = place.watch(process)
    ending = watch.follow()
    assert place.verdicts() == [(0, Verdict.PASSED)]
    assert (ending.interrupted, process.stopped) == (True, True)
    last = watch.finish(ending)
    assert last is not None
    assert last.result.verdict is Verdict.INTERRUPTED


def test_a_run_that_takes_too_long_is_stopped_and_the_next_ones_are_left(place: Place) -> None:
    process = Scripted(lambda: None, lambda: None)
    process.seconds = 9.0
    watch = place.watch(process, timeout=8)
    ending = watch.follow()
    last = watch.finish(ending)
    assert last is not None
    assert (process.stopped, last.exit_code) == (True, 143)
    assert "stopped after 8 s" in last.result.reason
    assert watch.left == RUNS[1:]


def test_a_job_that_ended_between_two_runs_leaves_the_rest(place: Place) -> None:
    watch = place.watch(Scripted(lambda: place.writes(0)))
    assert watch.finish(watch.follow()) is None
    assert (place.verdicts(), watch.left) == ([(0, Verdict.PASSED)], RUNS[1:])


ENDED, INTERRUPTED = Ending(3), Ending(None, interrupted=True)


@pytest.mark.parametrize(
    ("ended", "interrupted", "seconds", "timeout", "expected"),
    [
        (None, False, 9.0, None, None),
        (None, False, 9.0, 10, None),
        (None, False, 11.0, 10, Ending(None, timed_out=True)),
        (ENDED, False, 11.0, 10, ENDED),
        (None, True, 11.0, 10, INTERRUPTED),
        (ENDED, True, 0.0, None, INTERRUPTED),
    ],
)
def test_how_a_job_ends(
    ended: Ending | None,
    interrupted: bool,
    seconds: float,
    timeout: int | None,
    expected: Ending | None,
) -> None:
    assert final_ending(ended, interrupted, seconds, timeout) == expected
