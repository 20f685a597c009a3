"""Commands as child processes: one task at a time, its output kept, ended with the server."""

from __future__ import annotations

import dataclasses
import re
import signal
import subprocess
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Event, RLock, Thread, Timer
from typing import IO, Any

from robovast.base.errors import CannotRunError, ExitCode
from robovast.base.stopwatch import Stopwatch
from robovast.evaluation.launch.commands import as_shell

MOST_LINES = 1000
"""Lines of output that are kept, the last ones."""
LONGEST = 2000
"""Characters of a line; what is longer becomes several."""
GRACE = 20.0
"""From the first request to end to the second [s]; jobs get 10 s of it."""

_CONTROL = re.compile(r"\x1b\[[0-9;?]*[ -/]*[@-~]|[\x00-\x08\x0b-\x1f\x7f]")
_FOLLOWED = frozenset({ExitCode.OK, ExitCode.TEST_FAILED, ExitCode.RUN_ERRORED})
"""Exit codes of a campaign that has results."""


class BusyError(CannotRunError):
    """Something is being executed already."""


@dataclass(frozen=True)
class Launch:
    """A task that was started."""

    number: int
    """Tasks that this launcher has started, this one included."""
    command: str
    """Its first command, as one types it."""
    started: float
    """[s since the epoch]"""
    ended: float | None = None
    """[s since the epoch]; None while it is executed."""
    code: int | None = None
    """Exit code of its first command, as soon as that has ended; negative: a signal ended it."""
    stopping: bool = False
    """Whether it was told to end."""


class Launcher:
    """Executes `vast` in a group of its own; threads may share it."""

    def __init__(self, program: Sequence[str], grace: float = GRACE) -> None:
        """Args: words that `vast` is called with; time until a second request to end [s]."""
        self._program = tuple(program)
        self._grace = grace
        self._launch: Launch | None = None
        self._child: subprocess.Popen[str] | None = None
        self._lines: deque[str] = deque(maxlen=MOST_LINES)
        self._written = 0
        self._stopwatch = Stopwatch()
        self._ended = Event()
        self._lock = RLock()  # a signal handler may come in between
        self._ended.set()

    @property
    def launch(self) -> Launch | None:
        """The latest task."""
        return self._launch

    def output(self, since: int) -> tuple[int, list[str]]:
        """Lines of the latest task.

        Args:
            since: leave out this many.

        Returns:
            Number of the first line that is here, from 0, and the lines.
        """
        with self._lock:
            kept = self._written - len(self._lines)
            first = min(max(since, kept), self._written)
            return first, list(self._lines)[first - kept :]

    def start(self, words: Sequence[str], then: Sequence[str] = ()) -> Launch:
        """Execute a command, and another one once that has left results.

        Raises:
            BusyError: the task before has not ended.
            CannotRunError: the program cannot be started.
        """
        with self._lock:
            if not self._ended.is_set():
                raise BusyError("A campaign is being run from this page; wait for it, or stop it.")
            self._child = self._open(words)
            number = self._launch.number + 1 if self._launch else 1
            self._stopwatch = Stopwatch()
            launch = Launch(number, as_shell(words), self._stopwatch.period[0])
            self._launch = launch
            self._lines.clear()
            self._written = 0
            self._ended.clear()
        Thread(target=self._follow, args=(self._child, then), daemon=True, name="launch").start()
        return launch

    def stop(self) -> None:
        """Tell the task to end: as Ctrl-C does, and by SIGTERM from the second time on."""
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
        """Stop the task and wait for its end, at most twice the grace.

        It is never killed: it is what stops the jobs.
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
            )
        except (OSError, ValueError) as error:
            raise CannotRunError(f"{self._program[0]} cannot be started: {error}.") from None

    def _follow(self, child: subprocess.Popen[str], then: Sequence[str]) -> None:
        code = self._wait(child)
        self._change(code=code)
        try:
            following = self._next(code, then)
            if following is not None:
                self._wait(following)
        except CannotRunError as error:
            self._say(str(error))
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
        """Read what a process prints until it has ended, and what it left behind no longer."""
        reader = Thread(target=self._read, args=(child.stdout,), daemon=True, name="launch-output")
        reader.start()
        code = child.wait()
        reader.join(2)
        return code

    def _read(self, stream: IO[str]) -> None:
        with stream:
            while line := stream.readline(LONGEST):
                self._say(_CONTROL.sub("", line.rstrip("\n")))

    def _say(self, line: str) -> None:
        with self._lock:
            self._lines.append(line)
            self._written += 1

    def _change(self, **changes: Any) -> None:
        with self._lock:
            if self._launch is not None:
                self._launch = dataclasses.replace(self._launch, **changes)
