"""A run that writes nothing to its log is told, and not when it does again."""

from __future__ import annotations

import time
from pathlib import Path

from robovast.agent.silence import Silence


def test_a_run_is_silent_until_it_writes_again(tmp_path: Path) -> None:
    marker, log = tmp_path / "silent", tmp_path / "system.log"
    silence = Silence(marker, 0.2)

    def look(seconds: float) -> bool:
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            silence.look(lambda: log)
            time.sleep(0.02)
        return marker.exists()

    assert look(0.5), "there is no log at all"
    log.write_text("a line")
    assert not look(0.15)
    assert look(0.5)
    silence.end()
    assert not marker.exists()
    assert not look(0.1), "the next job has the whole time"


def test_without_a_limit_nothing_is_silent(tmp_path: Path) -> None:
    silence = Silence(tmp_path / "silent", 0)
    for _ in range(5):
        silence.look(lambda: tmp_path / "system.log")
        time.sleep(0.01)
    assert not list(tmp_path.iterdir())
