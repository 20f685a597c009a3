"""Postprocessing beside the server, so that the page is there before all tables are."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import IO

GRACE = 20.0
"""How long the process may take to keep what it has finished [s]."""
_LAST_WORDS = 10.0
"""How long its output may take to arrive once it has ended [s]."""


@dataclass(frozen=True)
class Prepared:
    """How far it is."""

    done: int
    """Campaigns whose tables are there."""
    total: int
    running: bool
    changed: bool = False
    """Whether any table was made; known at the end."""


class Preparation:
    """A process that makes the tables of campaigns; it is asked to end with the server."""

    def __init__(
        self, words: Sequence[str], campaigns: Collection[Path], say: Callable[[str], None]
    ) -> None:
        """Args: command line; folders of campaigns, perhaps none; prints what it says."""
        self._words = words
        self._campaigns = {path.name: path for path in campaigns}
        self._before = self._stamps()
        self._changed = False
        self._say = say
        self._process: subprocess.Popen[str] | None = None
        self._done: set[str] = set()
        self._running = bool(campaigns)
        self._asked_to_end = False

    def start(self) -> None:
        """Start it, unless there is nothing to do."""
        if not self._running:
            return
        # Ctrl-C must not reach it twice: from the terminal and from `end`.
        self._process = subprocess.Popen(
            self._words, stdout=subprocess.PIPE, text=True, errors="replace", start_new_session=True
        )
        Thread(target=self._follow, args=(self._process,), daemon=True, name="preparing").start()

    def state(self) -> Prepared:
        """How far it is now."""
        return Prepared(len(self._done), len(self._campaigns), self._running, self._changed)

    def end(self) -> None:
        """Ask it to end, and wait until it has kept what is finished."""
        process = self._process
        if process is None or process.poll() is not None:
            return
        self._asked_to_end = True
        process.send_signal(signal.SIGINT)
        try:
            process.wait(GRACE)
        except subprocess.TimeoutExpired:
            _kill_group(process)

    def _follow(self, process: subprocess.Popen[str]) -> None:
        """Wait for the process, not for its output: a child that outlives it may keep that open."""
        reader = Thread(target=self._read, args=(process.stdout,), daemon=True, name="prepared")
        reader.start()
        with suppress(ChildProcessError):  # `end`, which waits as well, was first
            os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        _kill_group(process)
        reader.join(_LAST_WORDS)
        code = process.wait()
        if code < 0 and not self._asked_to_end:
            self._say(
                f"The creation of tables was stopped by {signal.Signals(-code).name}. Complete it "
                "with `vast results postprocess`."
            )
        self._changed = self._stamps() != self._before
        self._running = False

    def _read(self, output: IO[str]) -> None:
        with output:
            for line in output:
                self._say(line.rstrip("\n"))
                name = line.rpartition(": ")[0]
                if name in self._campaigns:
                    self._done.add(name)

    def _stamps(self) -> dict[str, int]:
        """Times of the folders of campaigns, which change when tables in them do."""
        found = {}
        for name, path in self._campaigns.items():
            with suppress(OSError):  # removed meanwhile
                found[name] = path.stat().st_mtime_ns
        return found


def _kill_group(process: subprocess.Popen[str]) -> None:
    """End a process, and what it has started."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
