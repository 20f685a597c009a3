"""Watching a bucket's runs appear, from beside the S3 server."""

from __future__ import annotations

import json
import os
import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from gauntlet_truth import RECORD
from gauntlet_verdict import Stored

PAUSE = 0.5


class Watch:
    """Looks at the server's files again and again, and remembers when each record was there."""

    def __init__(self, buckets: Path) -> None:
        self._buckets = buckets
        self._known: dict[str, tuple[int, int]] = {}
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self.stored: defaultdict[str, list[Stored]] = defaultdict(list)
        """By bucket."""

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._over.wait(PAUSE):
            for path in self._records():
                with suppress(OSError, ValueError, KeyError):  # it may go while it is looked at
                    self._look(path)

    def _records(self) -> Iterator[Path]:
        for bucket in _folders(self._buckets):
            for variant in _folders(bucket):
                if variant.name.startswith("_"):
                    continue
                for run in _folders(variant):
                    yield run / RECORD

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
