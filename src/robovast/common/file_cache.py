"""Files that cost much to make, kept by a hash of what they were made from."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterable
from pathlib import Path


class FileCache:
    """A folder of files by key; entries appear complete or not at all.

    Args:
        cache_dir: the folder; made when it is needed. Default: `robovast` in the user's cache.
        name: a subfolder, so that different users of the cache do not meet.
    """

    def __init__(self, cache_dir: str | Path | None = None, name: str = "files") -> None:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        self._folder = (Path(cache_dir) if cache_dir else Path(base) / "robovast") / name

    def key(self, files: Iterable[str | Path], *values: object) -> str:
        """A key of the content of files and of further values, whatever the files' place."""
        digest = hashlib.sha256()
        for file in files:
            digest.update(hashlib.sha256(Path(file).read_bytes()).digest())
        digest.update(repr(values).encode())
        return digest.hexdigest()

    def get(self, key: str) -> Path | None:
        """The file kept under a key, or None."""
        path = self._folder / key
        return path if path.is_file() else None

    def put(self, key: str, file: str | Path) -> Path:
        """Keep a copy of a file under a key."""
        self._folder.mkdir(parents=True, exist_ok=True)
        temporary = self._folder / f".{key}.{os.getpid()}"
        shutil.copyfile(file, temporary)
        os.replace(temporary, self._folder / key)
        return self._folder / key
