"""Killing a program before each of its operations on files, one after the other."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator
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


class _Countdown:
    running = False
    left = 0


def _die_at(number: int, action: Callable[[], object]) -> None:
    _Countdown.left = number
    sys.addaudithook(_count)
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
