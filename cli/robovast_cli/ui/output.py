"""Printing while something runs: a reader that goes away must not stop it."""

from __future__ import annotations

import sys

import typer

from robovast.base.printable import printable
from robovast_cli.ui.report import silence_stdout


def say(line: str) -> None:
    """Print a line at once; nothing when the reader of stdout has gone."""
    try:
        sys.stdout.write(printable(line) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        silence_stdout()


def say_data(text: str) -> None:
    """Print what programs read: as it is, but to a terminal as it can be shown there."""
    sys.stdout.write(printable(text) if sys.stdout.isatty() else text)


def asked(question: str, *, default: bool) -> bool:
    """Ask the user.

    Raises:
        KeyboardInterrupt: there is no answer.
    """
    try:
        return typer.confirm(question, default=default)
    except typer.Abort:
        raise KeyboardInterrupt from None
