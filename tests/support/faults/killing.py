"""What remains of a program that is killed before any one of its operations on files."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

_EVENTS = ("open", "os.", "shutil.", "fcntl.", "ctypes.")
_MOST = 2000


def deaths(
    folder: Path, action: Callable[[Path], object], every: int = 1
) -> Iterator[tuple[int, Path]]:
    """Do something in a child that is killed before its first, second, third… operation on files.

    Args:
        folder: for the folders that the action gets, one for each death.
        action: is given its folder, which is empty; ends without dying when it has no more
            operations left.
        every: of so many operations one is tried.

    Yields:
        The number of the death, and the folder as the killed child left it.
    """
    for number in range(0, _MOST, every):
        place = folder / str(number)
        place.mkdir(parents=True)
        child = os.fork()
        if not child:
            _die_at(number, lambda place=place: action(place))
        _, status = os.waitpid(child, 0)
        if os.WIFEXITED(status):
            assert os.WEXITSTATUS(status) == 0, "the action failed: see its traceback"
            return
        yield number, place
    raise AssertionError(f"the action was not at its end after {_MOST} operations on files")


def begin_dying() -> None:
    """From here on the operations of the action are counted: what it prepares is not."""
    _Countdown.running = True


def states(folder: Path, watched: Path, action: Callable[[], object]) -> Iterator[Path]:
    """Copies of a folder: what a kill before each operation on files of an action would leave.

    The action runs once, in a child. A kill changes no file, so copying the folder before an
    operation is as good, and much cheaper. States that are alike are copied once.

    Args:
        folder: for the copies.
        watched: the folder that the action changes.
        action: ends without an exception.
    """
    folder.mkdir()
    child = os.fork()
    if not child:
        _end_after(action, _Camera(folder, watched))
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, "see its traceback"
    yield from sorted(folder.iterdir(), key=lambda copy: int(copy.name))


class _Camera:
    """Copies a folder before operations on files, if it has changed; other threads wait."""

    def __init__(self, folder: Path, watched: Path) -> None:
        self._folder, self._watched = folder, watched
        self._copies, self._last = 0, frozenset[object]()
        self._lock, self._thread = threading.Lock(), threading.local()

    def __call__(self, event: str, _: object) -> None:
        if not event.startswith(_EVENTS) or getattr(self._thread, "copies", False):
            return
        self._thread.copies = True
        with self._lock:
            found = frozenset(self._files())
            if found != self._last:
                target = self._folder / str(self._copies)
                shutil.copytree(self._watched, target, symlinks=True, copy_function=_copy)
                self._copies, self._last = self._copies + 1, found
        self._thread.copies = False

    def _files(self) -> Iterator[object]:
        for place, folders, names in os.walk(self._watched):
            for name in (*folders, *names):
                with suppress(FileNotFoundError):
                    found = os.lstat(f"{place}/{name}")
                    size = (found.st_size, found.st_mtime_ns) if name in names else ()
                    yield place, name, found.st_ino, size


def _copy(source: str, target: str) -> None:
    """Copy a file, unless another process has removed it."""
    with suppress(FileNotFoundError):
        shutil.copy2(source, target)


class _Countdown:
    running = False
    left = 0


def _die_at(number: int, action: Callable[[], object]) -> None:
    _Countdown.left = number
    _end_after(action, _count)


def _end_after(action: Callable[[], object], hook: Callable[[str, object], None]) -> None:
    sys.addaudithook(hook)
    code = 1
    try:
        action()
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _count(event: str, _: object) -> None:
    if _Countdown.running and event.startswith(_EVENTS):
        if not _Countdown.left:
            _Countdown.running = False  # the kill is an event, too
            os.kill(os.getpid(), signal.SIGKILL)
        _Countdown.left -= 1
