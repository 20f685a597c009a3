"""Errors for users, and their exit codes.

Each message says what is wrong, where and why; its hint says what to do. The command line prints
them in two lines (docs/contributing/style.md); `--log-level debug` adds a traceback.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

_USERINFO = re.compile(r"://[^/?#\s]*@")


class ExitCode(IntEnum):
    """Exit codes of `vast` (documented in docs/reference/exit-codes.md)."""

    OK = 0
    TEST_FAILED = 1
    """At least one run ended with a failed verdict."""
    BAD_INPUT = 2
    """The .vast file, a file that it refers to, or the command line is wrong."""
    CANNOT_RUN = 3
    """The runtime is not usable: Docker or the image is missing, or the image is incompatible."""
    RUN_ERRORED = 4
    """At least one run has no verdict (crash, timeout), and no run has failed."""
    STORAGE = 5
    """Results cannot be written: no permission, disk full, campaign exists."""
    UNCLEAR = 6
    """A comparison cannot tell whether something got worse, and was asked to be sure."""
    INTERNAL = 70
    """A bug in RoboVAST."""
    INTERRUPTED = 130
    """Ctrl-C."""


class RobovastError(Exception):
    """Base class of errors for users.

    Args:
        message: what failed and why, such as "cannot write into /data: the disk is full".
        hint: what to do, such as "choose another folder": without capital and period.
    """

    exit_code: ExitCode = ExitCode.INTERNAL

    def __init__(self, *message: object, hint: str = "") -> None:
        super().__init__(*message)
        self.hint = without_userinfo(hint)

    @property
    def message(self) -> str:
        """What failed and why, without the hint."""
        found = super().__str__() or str(self.__cause__ or "")
        return without_userinfo(found or "the cause is unknown")

    def __str__(self) -> str:
        return with_hint(self.message, self.hint)


def with_hint(message: str, hint: str) -> str:
    """Return a message and its hint as sentences of one text, as conditions and records need it.

    Each may be empty. The hint of a message with several lines is another line.
    """
    if not (message and hint):
        return message or hint
    last = _sentence(hint[:1].upper() + hint[1:])
    return f"{message}\n{last}" if "\n" in message else f"{_sentence(message)} {last}"


def one_of(names: Iterable[object], otherwise: str = "") -> str:
    """Return the hint to use one of these names; `otherwise` if there are none."""
    listed = ", ".join(map(str, names))
    return f"use one of {listed}" if listed else otherwise


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?", "…")) else f"{text}."


def without_userinfo(text: str) -> str:
    """A text without user names and passwords in its URLs."""
    return _USERINFO.sub("://", text)


class InputError(RobovastError):
    """The user's input is wrong: a file, a key, a value, an option."""

    exit_code = ExitCode.BAD_INPUT


class CannotRunError(RobovastError):
    """The chosen runtime cannot execute the campaign; nothing was started."""

    exit_code = ExitCode.CANNOT_RUN


class StorageError(RobovastError):
    """Results cannot be stored; finished runs are not affected."""

    exit_code = ExitCode.STORAGE


class RefusedError(StorageError):
    """A server refuses permanently: repeating the request cannot succeed."""


@dataclass(frozen=True, order=True)
class Place:
    """A position in a file; line and column count from 1, and 0 means the whole file."""

    file: Path
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else str(self.file)


@dataclass(frozen=True)
class Problem:
    """An error in a document, with a remedy."""

    place: Place
    key: str
    """Path of the key, such as `execution.resources.cpu` or `configuration[2].name`."""
    message: str
    remedy: str = ""
    is_lacking: bool = False
    """True if the document may be right, but this machine lacks a package for it."""

    def __str__(self) -> str:
        where = f"{self.place}: {self.key}: " if self.key else f"{self.place}: "
        return f"{where}{self.message}" + (f"\n    {self.remedy}" if self.remedy else "")


class DocumentError(InputError):
    """All problems found in one document."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        unique = dict.fromkeys(problems)
        self.problems = sorted(unique, key=lambda problem: problem.place)
        if self.problems and all(problem.is_lacking for problem in self.problems):
            self.exit_code = ExitCode.CANNOT_RUN
        super().__init__("\n".join(map(str, self.problems)))

    def __reduce__(self) -> tuple[Any, ...]:  # errors of expansion come from another process
        return type(self), (self.problems,)
