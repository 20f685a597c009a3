"""A run that writes nothing to its log is told, and not when it does again."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from robovast.agent import silent_runs as silence_module
from robovast.agent.silent_runs import Silence


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """What time it is; only the test lets it pass."""
    clock = SimpleNamespace(now=100.0)
    clock.monotonic = lambda: clock.now
    monkeypatch.setattr(silence_module, "time", clock)
    return clock


def test_a_run_is_silent_until_it_writes_again(tmp_path: Path, clock: SimpleNamespace) -> None:
    marker, log = tmp_path / "silent", tmp_path / "system.log"
    silence = Silence(marker, 0.2)

    def look(seconds: float) -> bool:
        for _ in range(round(seconds / 0.01)):
            clock.now += 0.01
            silence.look(lambda: log)
        return marker.exists()

    assert look(0.5), "there is no log at all"
    log.write_text("a line")
    assert not look(0.15)
    assert look(0.5)
    silence.end()
    assert not marker.exists()
    assert not look(0.1), "the next job has the whole time"


def test_without_a_limit_nothing_is_silent(tmp_path: Path, clock: SimpleNamespace) -> None:
    silence = Silence(tmp_path / "silent", 0)
    for _ in range(5):
        silence.look(lambda: tmp_path / "system.log")
        clock.now += 3600
    assert not list(tmp_path.iterdir())
