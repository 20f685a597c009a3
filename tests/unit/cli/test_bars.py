"""Bars of what takes its time: on terminals of any width, and nowhere else."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys

import pytest

from robovast_cli.ui.bars import Bars

SCRIPT = """
from robovast_cli.ui.bars import Bars
with Bars() as bars:
    for done in (0, 30, 100):
        bars("growth-sim-2026-01-02-030405", done * 10**6, 10**8, "7/10 files")
    print("a line between")
"""


@pytest.mark.parametrize("width", [60, 80, 140])
def test_a_bar_is_one_line_whatever_the_width(width: int) -> None:
    shown = on_terminal(COLUMNS=str(width))
    lines = re.split(r"[\r\n]+", re.sub(r"\x1b\[[\d?;]*[a-zA-Z]", "", shown))
    bars = [line.rstrip() for line in lines if "growth" in line]
    assert all(len(line) <= width and line.endswith(":00") for line in bars[-1:]), bars
    assert "100.0/100.0 MB" in bars[-1]
    assert "a line between" in [line.strip() for line in lines]


def test_no_color_is_obeyed() -> None:
    assert re.search(r"\x1b\[[\d;]*3\dm", on_terminal(COLUMNS="80"))
    assert not re.search(r"\x1b\[[\d;]*3\dm", on_terminal(COLUMNS="80", NO_COLOR="1"))


def test_without_a_terminal_nothing_is_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    with Bars() as bars:
        bars("campaign", 1, 2)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("term", ["xterm", "dumb"])
def test_a_dumb_terminal_gets_no_bar(term: str) -> None:
    assert ("growth" in on_terminal(TERM=term)) == (term == "xterm")


def on_terminal(**environment: str) -> str:
    """What a terminal is sent."""
    main, other = pty.openpty()
    known = {**{k: v for k, v in os.environ.items() if k != "NO_COLOR"}, "TERM": "xterm"}
    with subprocess.Popen(
        [sys.executable, "-c", SCRIPT], stdout=other, stderr=other, env={**known, **environment}
    ) as process:
        os.close(other)
        sent = b""
        while chunk := _read(main):
            sent += chunk
        assert process.wait(timeout=30) == 0, sent
    os.close(main)
    return sent.decode()


def _read(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, 65536)
    except OSError:  # Linux says so when the other side is closed
        return b""
