"""One process's clock jumps ahead and back; its steady clock, and all other processes, do not."""

from __future__ import annotations

import platform
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from robovast_testbed.clocks import shifted
from robovast_testbed.outages import Process

HOUR = 3600
TELLS = """\
import sys, threading, time
threading.Thread(target=lambda: [time.time() for _ in iter(int, 1)], daemon=True).start()
for _ in sys.stdin:
    print(time.time() - time.monotonic(), flush=True)
"""
"""Also reads the time in a loop, so that it is often in the code that changes."""


@contextmanager
def teller() -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-c", TELLS]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def shift(process: subprocess.Popen[str]) -> float:
    """How far its clock is from ours [s]."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write("?\n")
    told = float(process.stdout.readline())
    return told - (time.time() - time.monotonic())


@pytest.mark.skipif(platform.machine() != "x86_64", reason="clocks are shifted by code for x86-64")
def test_a_process_sees_another_time_of_day_for_a_while() -> None:
    with teller() as process:
        assert abs(shift(process)) < 1
        for seconds in (HOUR, -HOUR):
            with shifted(Process(process.pid, ()), seconds):
                assert abs(shift(process) - seconds) < 1
            assert abs(shift(process)) < 1


@pytest.mark.skipif(platform.machine() != "x86_64", reason="clocks are shifted by code for x86-64")
def test_a_process_may_end_meanwhile() -> None:
    with teller() as process:
        assert abs(shift(process)) < 1
        with shifted(Process(process.pid, ()), HOUR):
            process.kill()
            process.wait()
