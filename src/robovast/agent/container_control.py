"""The agent's side of start.sh: orders to the run's containers, and their answers."""

from __future__ import annotations

import fcntl
import math
import os
import re
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from threading import Thread

from robovast.agent.mounts import Folders
from robovast.base import safe_paths
from robovast.base.stopwatch import Stopwatch

ORDERS = ("order", "heartbeat")
"""Files in the folder of orders."""

HEARTBEAT = 5.0
"""How often the agent renews its sign of life [s]."""

_SIZE = 32
"""Files of orders are rewritten in place, whole, so that a full disk hinders nobody [byte]."""


class RunContainer:
    """The main container of a pod, which communicates by files alone.

    Its answers are in a folder that the runs' own code can write: anything may be there.
    """

    def __init__(self, folders: Folders) -> None:
        self._orders = folders.orders
        self._answers = folders.answers
        self._out = folders.out

    def begin(self) -> None:
        """Create the files of orders; the folders may be mounted already, so they stay."""
        for folder in (self._orders, self._out):
            folder.mkdir(parents=True, exist_ok=True)
        for name in ORDERS:
            (self._orders / name).write_bytes(_padded(""))

    def prepare(self) -> None:
        """Leave nothing in the output folder but that of the answers, whatever was put there."""
        for name in safe_paths.names(self._out, self._out):
            if self._out / name != self._answers:
                safe_paths.remove(self._out / name, self._out)
        safe_paths.make_folder(self._answers, self._out)
        safe_paths.create_file(self._answers / "lock", self._out).close()

    def run(self, job: int) -> None:
        """Order job 1, 2, …; its inputs must be in place.

        Answers that are there before are of other jobs, or of the image: they would end this one.
        """
        for name in safe_paths.names(self._answers, self._out):
            if name.startswith(f"{job}."):
                with suppress(OSError):  # another user's folder
                    safe_paths.remove(self._answers / name, self._out)
        _rewrite(self._orders / "order", f"run {job}")

    def stop(self, job: int) -> None:
        """Order the end of a job that is running."""
        _rewrite(self._orders / "order", f"stop {job}")

    def end(self) -> None:
        """Order the end of everything."""
        _rewrite(self._orders / "order", "end")

    def beat_for_ever(self) -> None:
        """Renew the sign of life periodically, until the agent ends."""
        Thread(target=self._beat, name="heartbeat", daemon=True).start()

    def _beat(self) -> None:
        while True:
            uptime = time.clock_gettime(time.CLOCK_BOOTTIME)
            with suppress(OSError):  # of a moment, as some disks have it when they are full
                _rewrite(self._orders / "heartbeat", f"{uptime:.0f}")
            time.sleep(HEARTBEAT)

    def started(self, job: int, most: float = math.inf) -> Stopwatch | None:
        """How long ago a job started, even if that is noticed late; None if it did not.

        Args:
            job: its number.
            most: how long ago it was ordered [s]: its container may have an uptime of its own.
        """
        found = self._answer(rf"{job}\.started\.(\d{{1,12}}\.\d{{1,9}})")
        status = safe_paths.status(self._answers / found[0], self._out) if found else None
        if found is None or status is None:
            return None
        late = time.clock_gettime(time.CLOCK_BOOTTIME) - float(found[1])
        return Stopwatch(status.st_mtime, min(max(late, 0.0), most))

    def exit_code(self, job: int) -> int | None:
        """The exit code of a job; None if it has not ended."""
        found = self._answer(rf"{job}\.code\.(\d{{1,3}})")
        return int(found[1]) if found else None

    def lacked_memory(self, job: int) -> bool:
        """True when the kernel killed processes of a job that ended for lack of memory."""
        return self._has_answered(f"{job}.oom")

    def _answer(self, pattern: str) -> re.Match[str] | None:
        """The answer whose name matches."""
        answers = safe_paths.names(self._answers, self._out)
        return next(filter(None, (re.fullmatch(pattern, name) for name in answers)), None)

    def all_over(self, job: int, secondaries: Iterable[str]) -> bool:
        """True when a job has ended in all secondary containers."""
        return all(self._has_answered(f"{job}.over.{name}") for name in secondaries)

    def is_terminated(self) -> bool:
        """True if somebody else asked the container to end."""
        return self._has_answered("terminated")

    def _has_answered(self, answer: str) -> bool:
        return safe_paths.status(self._answers / answer, self._out) is not None

    def is_gone(self, job: int) -> bool:
        """True when the container was killed before it could end a job, or before it began one."""
        held = self._has_answered("held") or self.started(1) is not None
        return held and self._is_free() and self.exit_code(job) is None

    def _is_free(self) -> bool:
        """True if nobody holds the lock; a run that removed it is not protected."""
        try:
            with safe_paths.open_file(self._answers / "lock", self._out) as file:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            return True
        return True


def _padded(text: str) -> bytes:
    return text.ljust(_SIZE - 1).encode("ascii") + b"\n"


def _rewrite(path: Path, text: str) -> None:
    file = os.open(path, os.O_WRONLY)
    try:
        os.pwrite(file, _padded(text), 0)
    finally:
        os.close(file)
