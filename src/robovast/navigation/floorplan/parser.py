"""Parses files with textX and determines positions in them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from textx import metamodel_from_file
from textx.exceptions import TextXSyntaxError

from robovast.base.errors import DocumentError, Place, Problem
from robovast.base.file_errors import read_text
from robovast.navigation.floorplan.mistakes import describe_error

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "deg": 0.017453292519943295, "rad": 1.0}
"""Factors to metres and radians."""

ANGLES = frozenset({"deg", "rad"})

_NO_NUMBER = re.compile(r"//[^\n]*|/\*.*?\*/|\"[^\"]*\"|'[^']*'", re.DOTALL)
"""Comments and texts."""
_NUMBER = re.compile(r"(?<![\w.])-?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?", re.ASCII)
_LONGEST = 100
"""Longest number [characters]."""
_LARGEST = 1e9


class ParsedFile:
    """A parsed file.

    Args:
        path: the file.
        grammar: name of a grammar beside this module.

    Raises:
        InputError: the file cannot be read.
        DocumentError: a syntax error, with line and column.
    """

    def __init__(self, path: Path, grammar: str) -> None:
        self.path = path
        self.problems: list[Problem] = []
        self.text = read_text(path)
        for number in _NUMBER.finditer(_NO_NUMBER.sub(_blank, self.text)):
            if len(number[0]) > _LONGEST or abs(float(number[0])) > _LARGEST:
                place = _place(path, self.text, number.start())
                message = f"the number {number[0][:20]} is too large"
                raise DocumentError([Problem(place, "", message, "It may be at most ±1e9.")])
        try:
            self.model: Any = _metamodel(grammar).model_from_str(self.text)
        except TextXSyntaxError as error:
            place = Place(path, error.line, error.col)
            raise DocumentError([Problem(place, "", *describe_error(error, self.text))]) from None

    def place(self, node: Any) -> Place:
        """Position of a node's beginning."""
        return _place(self.path, self.text, node._tx_position)

    def problem(self, node: Any, message: str, remedy: str = "") -> None:
        """Collect an error about a node; `finish` reports it."""
        self.problems.append(Problem(self.place(node), "", message, remedy))

    def finish(self) -> None:
        """Report the collected errors.

        Raises:
            DocumentError: errors were collected.
        """
        if self.problems:
            raise DocumentError(self.problems)


def _blank(found: re.Match[str]) -> str:
    """As many characters, so that places stay, and a space between the neighbors."""
    return " " * len(found[0])


def _place(path: Path, text: str, position: int) -> Place:
    before = text[:position]
    return Place(path, before.count("\n") + 1, len(before) - before.rfind("\n"))


def kind(node: Any) -> str:
    """Name of the grammar rule of a node."""
    return type(node).__name__


@cache
def _metamodel(grammar: str) -> Any:
    return metamodel_from_file(str(Path(__file__).with_name(grammar)), autokwd=True)
