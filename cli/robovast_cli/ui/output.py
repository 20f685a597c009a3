"""Print during a running campaign, which a closed pipe must not stop."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable
from typing import Any

import typer

from robovast.base.printable import printable, printable_json
from robovast_cli.ui.live_view import is_live
from robovast_cli.ui.report import silence_stdout


def echo(line: str, *, colour: bool = False) -> None:
    """Print a line immediately; do nothing if the reader of stdout has closed the pipe."""
    text = printable(line)
    try:
        sys.stdout.write((_VERDICT.sub(_coloured, text) if colour else text) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        silence_stdout()


_COLOURS = {"passed": 32, "failed": 31, "errored": 33, "interrupted": 2}
"""Colors as in `live_view`, as codes of ECMA-48."""
_VERDICT = re.compile(
    rf"^(?:{'|'.join(_COLOURS)})\b|\b[1-9]\d* (?P<counted>{'|'.join(_COLOURS)})\b"
)


def echo_verdicts(line: str) -> None:
    """Print a line; on a terminal, verdicts at its start and after numbers are colored."""
    echo(line, colour=is_live(sys.stdout) and "NO_COLOR" not in os.environ)


def _coloured(found: re.Match[str]) -> str:
    return f"\x1b[{_COLOURS[found['counted'] or found[0]]}m{found[0]}\x1b[0m"


def echo_data(text: str) -> None:
    """Print text for programs unchanged, but only printable characters on a terminal.

    Lone surrogates, which cannot be encoded, are written as `\\ud800`.
    """
    encodable = text.encode("utf-8", "backslashreplace").decode()
    sys.stdout.write(printable(text) if sys.stdout.isatty() else encodable)


def echo_json(data: Any) -> None:
    """Print data as JSON."""
    echo_data(printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n")


def json_list(items: Iterable[str]) -> str:
    """Return a JSON list of items that are JSON, one in each line."""
    return printable_json("[\n" + ",\n".join(items) + "\n]\n")


def ask(question: str, *, default: bool) -> bool:
    """Ask the user.

    Raises:
        KeyboardInterrupt: there is no answer.
    """
    try:
        return typer.confirm(question, default=default)
    except typer.Abort:
        raise KeyboardInterrupt from None
