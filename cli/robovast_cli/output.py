"""Printing while something runs: a reader that goes away must not stop it."""

from __future__ import annotations

import sys

from robovast_cli.report import silence_stdout


def say(line: str) -> None:
    """Print a line at once; nothing when the reader of stdout has gone."""
    try:
        sys.stdout.write(line + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        silence_stdout()
