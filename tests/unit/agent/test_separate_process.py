"""Work in a process of its own: how it ends, and what its original hears of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Event, Thread

import pytest

from robovast.agent.separate_process import apart


def nothing() -> None:
    """What is begun meanwhile."""


@pytest.mark.parametrize("code", [0, 1, 65])
def test_its_exit_code_is_told_and_nothing_of_it_stays(code: int, tmp_path: Path) -> None:
    mark: list[int] = []

    def work() -> int:
        mark.append(1)
        (tmp_path / "pid").write_text(str(os.getpid()))
        return code

    assert apart(work, nothing, Event()) == code
    assert mark == [], "it has worked on a copy"
    assert int((tmp_path / "pid").read_text()) != os.getpid()


def test_a_signal_that_ends_it_is_told() -> None:
    def work() -> int:
        os.kill(os.getpid(), signal.SIGKILL)
        return 0

    assert apart(work, nothing, Event()) == -signal.SIGKILL


def test_a_mistake_of_ours_is_in_the_log(capfd: pytest.CaptureFixture[str]) -> None:
    def work() -> int:
        print("so far")
        raise ValueError("a mistake")

    assert apart(work, nothing, Event()) == 1
    out, err = capfd.readouterr()
    assert out == "so far\n"
    assert "ValueError: a mistake" in err


def test_it_ends_no_caller_twice(tmp_path: Path) -> None:
    """Neither an exit nor its clean-up of the caller is done in the copy."""
    log = tmp_path / "log"
    try:
        apart(lambda: sys.exit(3), nothing, Event())
    finally:
        with log.open("a") as file:
            file.write("cleaned up\n")
    assert log.read_text() == "cleaned up\n"


def test_it_is_ended_when_its_original_is_told_to_end() -> None:
    stop = Event()

    def work() -> int:
        time.sleep(600)
        return 0

    def meanwhile() -> None:
        Thread(target=lambda: (time.sleep(0.2), stop.set())).start()

    assert apart(work, meanwhile, stop) == -signal.SIGKILL


AT_EACH_LINE = """\
import signal, sys, threading, time
from robovast.agent import separate_process as apart
from robovast.base.signals import call_on_signals

def at_line(line):
    left = line

    def look(frame, event, _):
        nonlocal left
        if event == "line" and frame.f_code.co_filename in (apart.__file__, threading.__file__):
            left -= 1
            if left == 0:
                signal.raise_signal(signal.SIGTERM)
        return look

    def meanwhile():
        sys.settrace(look)
        sys._getframe(1).f_trace = look

    stop = threading.Event()
    with call_on_signals(stop.set):
        apart.apart(lambda: time.sleep(60) or 0, meanwhile, stop)
        sys.settrace(None)

for line in range(1, 20):
    at_line(line)
"""


def test_a_signal_at_any_moment_ends_it() -> None:
    """Its handler must not need what the interrupted line holds."""
    subprocess.run([sys.executable, "-c", AT_EACH_LINE], timeout=60, check=True)
