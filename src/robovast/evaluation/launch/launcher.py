"""Executes commands as child processes, one task at a time; they end with the server."""

from __future__ import annotations

import dataclasses
import os
import re
import shutil
import signal
import subprocess
import weakref
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp
from threading import Event, RLock, Thread, Timer
from typing import IO, Any

from robovast.base.errors import CannotRunError, ExitCode
from robovast.base.stopwatch import Stopwatch
from robovast.base.task_record import VARIABLE, read_facts
from robovast.evaluation.launch.commands import as_shell

MOST_LINES = 1000
"""Number of last output lines that are kept."""
LONGEST = 2000
"""Longest line [characters]; longer ones are split."""
GRACE = 20.0
"""Time between the first and the second request to end [s]; jobs get 10 s of it."""

_CONTROL = re.compile(r"\x1b\[[0-9;?]*[ -/]*[@-~]|[\x00-\x08\x0b-\x1f\x7f]")
_FOLLOWED = frozenset({ExitCode.OK, ExitCode.TEST_FAILED, ExitCode.RUN_ERRORED})
"""Exit codes after which a campaign has results."""


class BusyError(CannotRunError):
    """Another task is in progress."""


@dataclass(frozen=True)
class Launch:
    """A started task."""

    number: int
    """Number of tasks started by this launcher, including this one."""
    command: str
    """Its first command in shell syntax."""
    campaign: str
    """The campaign on whose page it was started; empty for one of the document."""
    makes: str
    """The campaign whose runs it executes; empty until the command has created it."""
    run: str
    """If it reproduces a run: `<variant>/<number>`."""
    started: float
    """[s since the epoch]"""
    ended: float | None = None
    """[s since the epoch]; None while it is in progress."""
    code: int | None = None
    """Exit code of its first command, once that has ended; negative for signals."""
    stopping: bool = False
    """Whether it was asked to end."""
    error: str = ""
    """Why its first command failed, if it reported an error."""


class Launcher:
    """Executes `vast` in its own process group; thread-safe."""

    def __init__(self, program: Sequence[str], grace: float = GRACE) -> None:
        """Args: command line of `vast`; time until the second request to end [s]."""
        self._program = tuple(program)
        self._grace = grace
        self._launch: Launch | None = None
        self._child: subprocess.Popen[str] | None = None
        self._record = Path(mkdtemp(prefix="robovast-launch-")) / "record"
        weakref.finalize(self, shutil.rmtree, self._record.parent, ignore_errors=True)
        self._lines: deque[str] = deque(maxlen=MOST_LINES)
        self._written = 0
        self._stopwatch = Stopwatch()
        self._ended = Event()
        self._lock = RLock()  # a signal handler may need it while it is held
        self._ended.set()

    @property
    def launch(self) -> Launch | None:
        """The latest task, with what its command has reported."""
        with self._lock:
            if self._launch is not None and self._launch.ended is None:
                self._learn()
            return self._launch

    def output(self, since: int) -> tuple[int, list[str]]:
        """Output lines of the latest task.

        Args:
            since: number of lines to skip.

        Returns:
            Number of the first returned line, from 0, and the lines.
        """
        with self._lock:
            kept = self._written - len(self._lines)
            first = min(max(since, kept), self._written)
            return first, list(self._lines)[first - kept :]

    def start(
        self,
        words: Sequence[str],
        then: Sequence[str] = (),
        campaign: str = "",
        makes: str = "",
        run: str = "",
    ) -> Launch:
        """Execute a command, and then another one if the first leaves results.

        Args:
            words: the command's arguments.
            then: those of the other one.
            campaign: see `Launch`.
            makes: see `Launch`; empty for a campaign that the command creates.
            run: see `Launch`.

        Raises:
            BusyError: the previous task has not ended.
            CannotRunError: the program cannot be started.
        """
        with self._lock:
            if not self._ended.is_set():
                raise BusyError(
                    "A campaign is being run from this page", hint="wait for it, or stop it"
                )
            self._record.unlink(missing_ok=True)
            self._child = self._open(words)
            number = self._launch.number + 1 if self._launch else 1
            self._stopwatch = Stopwatch()
            begun = self._stopwatch.period[0]
            launch = Launch(number, as_shell(words), campaign, makes, run, begun)
            self._launch = launch
            self._lines.clear()
            self._written = 0
            self._ended.clear()
        Thread(target=self._follow, args=(self._child, then), daemon=True, name="launch").start()
        return launch

    def stop(self) -> None:
        """Ask the task to end: first by SIGINT (Ctrl-C), from the second call on by SIGTERM."""
        with self._lock:
            if self._child is None or self._launch is None or self._ended.is_set():
                return
            again = self._launch.stopping
            self._launch = dataclasses.replace(self._launch, stopping=True)
            self._child.send_signal(signal.SIGTERM if again else signal.SIGINT)
        if not again:
            timer = Timer(self._grace, self._stop_again, args=(self._launch.number,))
            timer.daemon = True
            timer.start()

    def end(self) -> None:
        """Stop the task and wait for its end, at most twice the grace period.

        It is never killed, since it must stop its jobs.
        """
        self.stop()
        self._ended.wait(2 * self._grace)

    def _stop_again(self, number: int) -> None:
        if self._launch is not None and self._launch.number == number:
            self.stop()

    def _open(self, words: Sequence[str]) -> subprocess.Popen[str]:
        try:
            return subprocess.Popen(
                [*self._program, *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                encoding="utf-8",
                errors="replace",
                start_new_session=True,
                env={**os.environ, VARIABLE: str(self._record)},
            )
        except (OSError, ValueError) as error:
            raise CannotRunError(f"{self._program[0]} cannot be started: {error}.") from None

    def _follow(self, child: subprocess.Popen[str], then: Sequence[str]) -> None:
        code = self._wait(child)
        with self._lock:
            self._learn()
            self._change(code=code)
        try:
            following = self._next(code, then)
            if following is not None:
                self._wait(following)
        except CannotRunError as error:
            self._print_line(str(error))
        self._change(ended=self._stopwatch.period[1])
        self._ended.set()

    def _next(self, code: int, then: Sequence[str]) -> subprocess.Popen[str] | None:
        with self._lock:
            stopping = self._launch is not None and self._launch.stopping
            if not then or stopping or code not in _FOLLOWED:
                return None
            self._child = self._open(then)
            return self._child

    def _wait(self, child: subprocess.Popen[str]) -> int:
        """Read a process's output until it ends; ignore what its children print later."""
        reader = Thread(target=self._read, args=(child.stdout,), daemon=True, name="launch-output")
        reader.start()
        code = child.wait()
        reader.join(2)
        return code

    def _read(self, stream: IO[str]) -> None:
        with stream:
            while line := stream.readline(LONGEST):
                self._print_line(_CONTROL.sub("", line.rstrip("\n")))

    def _print_line(self, line: str) -> None:
        with self._lock:
            self._lines.append(line)
            self._written += 1

    def _learn(self) -> None:
        """Take over what the first command has reported; the second one creates no campaign."""
        launch = self._launch
        if launch is not None and launch.code is None:
            facts = read_facts(self._record)
            self._change(
                makes=launch.makes or facts.get("campaign", ""),
                error=facts.get("error", ""),
            )

    def _change(self, **changes: Any) -> None:
        with self._lock:
            if self._launch is not None:
                self._launch = dataclasses.replace(self._launch, **changes)
