"""Errors that reach a user, and the exit code of each kind.

Every message says what is wrong, where, why, and how to mend it. The command line prints the
message alone; a traceback appears only when the user asks for one (`--log-level debug`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

_USERINFO = re.compile(r"://[^/?#\s]*@")


class ExitCode(IntEnum):
    """Exit codes of `vast` (documented in docs/cli.md)."""

    OK = 0
    TEST_FAILED = 1
    """At least one run ended with a failed verdict."""
    BAD_INPUT = 2
    """The .vast file, a file that it names or the command line is wrong."""
    CANNOT_RUN = 3
    """The runtime cannot run it: no Docker, no such image, an incompatible image."""
    RUN_ERRORED = 4
    """At least one run ended without a verdict (crash, timeout), none merely failed."""
    STORAGE = 5
    """Results cannot be written: no permission, disk full, campaign exists."""
    INTERNAL = 70
    """A fault of RoboVAST itself."""
    INTERRUPTED = 130
    """Ctrl-C."""


class RobovastError(Exception):
    """Base of every error that is meant for a user."""

    exit_code: ExitCode = ExitCode.INTERNAL

    def __str__(self) -> str:
        return without_userinfo(super().__str__())


def without_userinfo(text: str) -> str:
    """A text in whose URLs nobody's name and password stands."""
    return _USERINFO.sub("://", text)


class InputError(RobovastError):
    """What the user gave is wrong: a file, a key, a value, an option."""

    exit_code = ExitCode.BAD_INPUT


class CannotRunError(RobovastError):
    """The chosen runtime cannot run the campaign; nothing was started."""

    exit_code = ExitCode.CANNOT_RUN


class StorageError(RobovastError):
    """Results cannot be stored; finished runs stay as they are."""

    exit_code = ExitCode.STORAGE


class RefusedError(StorageError):
    """A server refuses for good: the same request can never succeed."""


@dataclass(frozen=True, order=True)
class Place:
    """A place in a file; line and column count from 1, 0 means the whole file."""

    file: Path
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else str(self.file)


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a document, and what would be right."""

    place: Place
    key: str
    """Path of the key, as `execution.resources.cpu` or `configuration[2].name`."""
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        where = f"{self.place}: {self.key}: " if self.key else f"{self.place}: "
        return f"{where}{self.message}" + (f"\n    {self.remedy}" if self.remedy else "")


class DocumentError(InputError):
    """Every problem found in one document."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        unique = dict.fromkeys(problems)
        self.problems = sorted(unique, key=lambda problem: problem.place)
        super().__init__("\n".join(map(str, self.problems)))
