"""Calls plugins in a separate process, with a time limit."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import IO, Any

from robovast.analysis.postprocessing.outcome import CommandOutcome

TOOLS = Path(__file__).parent / "tools"
"""Folder of programs on the plugins' PATH, such as `docker_exec.sh`."""
_START = 60.0
"""Time limit for the start of a process [s]."""
_PIECE = 1 << 16


class StoppedError(Exception):
    """The user asked to stop; work in progress is not finished."""


class PluginWorker:
    """A process that calls one plugin at a time; it is replaced if a plugin ends or blocks it."""

    def __init__(self, log: IO[bytes], time_limit: float, stopped: threading.Event) -> None:
        self._log = log
        self._limit = time_limit
        self._stopped = stopped
        self._process: subprocess.Popen[bytes] | None = None
        self._replies = -1
        self._scratch = TemporaryDirectory(prefix="robovast-postprocessing-")

    def __enter__(self) -> PluginWorker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        """End the process and remove its temporary files."""
        self.close()
        self._scratch.cleanup()

    def per_run(self, call: Mapping[str, Any]) -> bool:
        """Whether a plugin wants to be called for each run."""
        reply = self._ask({**call, "ask": "per_run"})
        return reply is True

    def call(self, call: Mapping[str, Any]) -> CommandOutcome:
        """Call a plugin; crashes and hangs also produce an outcome.

        Args:
            call: `name`, `parameters`, `folder`, `results_dir`, `campaign`.

        Raises:
            StoppedError: the user asked to stop meanwhile.
        """
        reply = self._ask({**call, "ask": "call", "scratch": self._scratch.name})
        return (
            CommandOutcome(**reply)
            if isinstance(reply, dict)
            else CommandOutcome(False, str(reply))
        )

    def convert_bags(self, calls: Sequence[Mapping[str, Any]]) -> list[CommandOutcome]:
        """Execute several bag commands in one pass; returns an outcome for each.

        Raises:
            StoppedError: the user asked to stop meanwhile.
        """
        reply = self._ask({"ask": "bags", "calls": calls})
        if isinstance(reply, list):
            return [CommandOutcome(**outcome) for outcome in reply]
        return [CommandOutcome(False, str(reply)) for _ in calls]

    def close(self) -> None:
        """End the process and everything it started."""
        from robovast.execution.local.process_tree import stop  # slow to import, and rarely needed

        if self._process is not None:
            stop(self._process, grace=1.0)
            if self._process.stdin is not None:
                with contextlib.suppress(OSError):
                    self._process.stdin.close()
            os.close(self._replies)
            self._process = None

    def _ask(self, request: Mapping[str, Any]) -> Any:
        """The reply; a text with the reason if there is none."""
        process = self._running()
        try:
            assert process.stdin is not None  # noqa: S101  # it is a pipe
            process.stdin.write(json.dumps(request, default=str).encode() + b"\n")
            process.stdin.flush()
        except BrokenPipeError:
            return self._ended()
        line = self._line(time.monotonic() + self._limit)
        if line is None:
            self.close()
            return (
                f"did not end within {self._limit:g} s and was stopped; `--time-limit` sets how "
                "long a command may take"
            )
        return json.loads(line) if line else self._ended()

    def _line(self, deadline: float) -> bytes | None:
        """The next line; empty at the end of the process, None after the deadline."""
        line = b""
        while not line.endswith(b"\n"):
            self._refuse_when_stopped()
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            if select.select([self._replies], [], [], min(left, 0.2))[0]:
                piece = os.read(self._replies, _PIECE)
                if not piece:
                    return b""
                line += piece
        return line

    def _refuse_when_stopped(self) -> None:
        if self._stopped.is_set():
            self.close()
            raise StoppedError

    def _running(self) -> subprocess.Popen[bytes]:
        self._refuse_when_stopped()
        if self._process is None:
            self._replies, theirs = os.pipe()
            command = [sys.executable, "-m", "robovast.analysis.postprocessing.child", str(theirs)]
            try:
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=self._log,
                    stderr=self._log,
                    env={**os.environ, "PATH": f"{TOOLS}:{os.environ.get('PATH', '')}"},
                    pass_fds=(theirs,),
                    start_new_session=True,
                )
            finally:
                os.close(theirs)
            self._line(time.monotonic() + _START)  # the start does not count as the plugin's time
        return self._process

    def _ended(self) -> str:
        """How the process ended by itself."""
        assert self._process is not None  # noqa: S101  # it was asked
        code = self._process.wait()
        self.close()
        if code >= 0:
            return f"ended its process with exit code {code} instead of returning"
        return f"crashed ({signal.Signals(-code).name})"
