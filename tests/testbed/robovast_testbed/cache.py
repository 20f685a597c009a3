"""Files that outlive a testbed: built programs, root file systems, images.

Everything lies outside the repository, under ``$ROBOVAST_TESTBED_CACHE``
(default ``$XDG_CACHE_HOME/robovast-testbed``), and is keyed by version or content.
"""

import contextlib
import fcntl
import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from . import leftovers
from .errors import Unavailable


def root() -> Path:
    """Return the cache folder, made when missing."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(os.environ.get("ROBOVAST_TESTBED_CACHE") or Path(base) / "robovast-testbed")
    folder.mkdir(parents=True, exist_ok=True)
    return folder.resolve()


@contextmanager
def locked(name: str) -> Iterator[None]:
    """Hold an exclusive lock between processes; the kernel drops it when its owner dies."""
    with lock_file(name).open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def lock_file(name: str) -> Path:
    """Return the file that the lock `name` is taken on."""
    folder = root() / "locks"
    folder.mkdir(exist_ok=True)
    return folder / f"{name.replace('/', '_')}.lock"


def once(key: str, make: Callable[[Path], None]) -> Path:
    """Return the cached folder `key`, calling `make` with an empty folder to fill when missing.

    Safe in parallel; a folder appears only when it is complete.

    :raises Unavailable: it is missing, with ``ROBOVAST_TESTBED=off``.
    """
    target = root() / "store" / key
    if target.exists():
        with contextlib.suppress(OSError):  # a cache of somebody else
            os.utime(target)
        return target
    if os.environ.get("ROBOVAST_TESTBED") == "off":
        raise Unavailable(f"{key} is not built; `scripts/test --all` builds it")
    with locked(key):
        if target.exists():
            return target
        work = root() / "scratch" / key.replace("/", "_")
        _discard(work)  # what a crash has left
        work.mkdir(parents=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            make(work)
            work.rename(target)
        finally:
            _discard(work)
    return target


def forget(pattern: str, unused: float) -> None:
    """Remove cached folders whose key matches a glob and that nobody asked for, for so long [s]."""
    for folder in (root() / "store").glob(pattern):
        with contextlib.suppress(FileNotFoundError):  # somebody else removes it
            if folder.stat().st_mtime < time.time() - unused:
                _discard(folder)


def _discard(folder: Path) -> None:
    leftovers.unmount(folder)
    shutil.rmtree(folder, ignore_errors=True)


def digest(paths: Iterable[Path], *more: str) -> str:
    """Return a short hash of files (whole folders too), by relative name and content.

    Bytecode is left out: it appears as soon as somebody imports the code.
    """
    total = hashlib.sha256()
    for text in more:
        total.update(text.encode() + b"\0")
    for path in paths:
        files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        for file in (f for f in files if f.parent.name != "__pycache__"):
            name = file.relative_to(path).as_posix() if path.is_dir() else file.name
            total.update(f"{name}\0{file.stat().st_mode & 0o111:o}\0".encode())
            total.update(file.read_bytes() + b"\0")
    return total.hexdigest()[:16]
