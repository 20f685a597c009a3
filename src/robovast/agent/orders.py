"""The agent's side of start.sh: orders to the run's containers, and their answers."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterable
from pathlib import Path
from threading import Thread

from robovast.agent.folders import Folders

HEARTBEAT = 5.0
"""How often the agent says that it lives [s]."""

_SIZE = 32
"""Files of orders are rewritten in place, whole, so that a full disk hinders nobody [byte]."""


class RunContainer:
    """The main container of a pod, which is known by files alone."""

    def __init__(self, folders: Folders) -> None:
        self._config = folders.config
        self._answers = folders.answers

    def prepare(self) -> None:
        """Make the files, before any container is started."""
        self._answers.mkdir(parents=True)
        (self._answers / "lock").touch()
        for name in ("order", "heartbeat"):
            (self._config / name).write_bytes(_padded(""))

    def run(self, job: int) -> None:
        """Order a job: 1, 2, …; what it needs is there."""
        _rewrite(self._config / "order", f"run {job}")

    def stop(self, job: int) -> None:
        """Order the end of a job that is running."""
        _rewrite(self._config / "order", f"stop {job}")

    def end(self) -> None:
        """Order the end of everything."""
        _rewrite(self._config / "order", "end")

    def beat_for_ever(self) -> None:
        """Say from time to time that the agent lives, until it does not."""
        Thread(target=self._beat, name="heartbeat", daemon=True).start()

    def _beat(self) -> None:
        while True:
            _rewrite(self._config / "heartbeat", str(time.monotonic_ns()))
            time.sleep(HEARTBEAT)

    def started(self, job: int) -> float | None:
        """When a job began [s since the epoch]; None when it did not."""
        try:
            return (self._answers / f"{job}.started").stat().st_mtime
        except FileNotFoundError:
            return None

    def exit_code(self, job: int) -> int | None:
        """How a job ended; None when it did not."""
        codes = (path.suffix[1:] for path in self._answers.glob(f"{job}.code.*"))
        return next(map(int, codes), None)

    def all_over(self, job: int, secondaries: Iterable[str]) -> bool:
        """True when a job has ended in all secondary containers."""
        return all((self._answers / f"{job}.over.{name}").exists() for name in secondaries)

    def is_terminated(self) -> bool:
        """True when the container was told to end, by somebody else."""
        return (self._answers / "terminated").exists()

    def is_gone(self, job: int) -> bool:
        """True when the container was killed before it could end a job.

        Whoever starts the first job holds the lock.
        """
        return (
            self.started(1) is not None
            and _is_free(self._answers / "lock")
            and self.exit_code(job) is None
        )


def _padded(text: str) -> bytes:
    return text.ljust(_SIZE - 1).encode("ascii") + b"\n"


def _rewrite(path: Path, text: str) -> None:
    file = os.open(path, os.O_WRONLY)
    try:
        os.pwrite(file, _padded(text), 0)
    finally:
        os.close(file)


def _is_free(lock: Path) -> bool:
    with lock.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True
