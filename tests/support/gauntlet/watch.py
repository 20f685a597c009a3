"""Watching a bucket's runs appear, from beside the S3 server, and keeping what would go."""

from __future__ import annotations

import json
import os
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from support.gauntlet.truth import RECORD
from support.gauntlet.verdict import Stored

PAUSE = 0.5


class Companion(threading.Thread):
    """Works beside; what ended it is raised where it is awaited."""

    def __init__(self, work: Callable[[], None]) -> None:
        super().__init__(daemon=True)
        self._work = work
        self._error: Exception | None = None

    def run(self) -> None:
        try:
            self._work()
        except Exception as error:
            self._error = error

    def end(self) -> None:
        self.join()
        if self._error:
            raise self._error


class Watch:
    """Looks at files again and again: remembers when each record was there, and keeps all logs."""

    def __init__(self, buckets: Path, logs: Path, kept: Path) -> None:
        """
        Args:
            buckets: the S3 server's folder.
            logs: of containers, which go with their pods.
            kept: where logs stay, on the same file system.
        """
        self._buckets, self._logs, self._kept = buckets, logs, kept
        self._known: dict[str, tuple[int, int]] = {}
        self._over = threading.Event()
        self._thread = Companion(self._watch)
        self.stored: defaultdict[str, list[Stored]] = defaultdict(list)
        """By bucket."""

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.end()

    def _watch(self) -> None:
        while not self._over.wait(PAUSE):
            for path in self._records():
                with suppress(OSError, ValueError, KeyError):  # it may go while it is looked at
                    self._look(path)
            with suppress(OSError):
                for path in self._logs.glob("*/*/*.log"):
                    self._keep(path)

    def _records(self) -> Iterator[Path]:
        for bucket in _folders(self._buckets):
            for variant in _folders(bucket):
                if variant.name.startswith("_"):
                    continue
                for run in _folders(variant):
                    yield run / RECORD

    def _keep(self, log: Path) -> None:
        place = self._kept / log.relative_to(self._logs)
        if not place.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            place.hardlink_to(log)

    def _look(self, path: Path) -> None:
        state = path.stat()
        version = (state.st_ino, state.st_mtime_ns)
        if self._known.get(str(path)) == version:
            return
        record = json.loads(path.read_bytes())
        run = f"{record['variant']}/{record['run']}"
        seen = Stored(time.time(), run, record["attempt"], record["verdict"])
        self.stored[path.parents[2].name].append(seen)
        self._known[str(path)] = version


def _folders(path: Path) -> list[Path]:
    with suppress(OSError), os.scandir(path) as entries:
        return [Path(entry.path) for entry in entries if entry.is_dir(follow_symlinks=False)]
    return []
