"""Checks the syntax of a scenario before any run fails because of it."""

from __future__ import annotations

import json
import logging
import subprocess
from contextlib import suppress
from pathlib import Path
from typing import Any

from robovast.base.errors import DocumentError, Place, Problem, StorageError
from robovast.base.file_cache import ContentCache
from robovast.base.file_errors import read_text
from robovast.execution.local.process_environment import existing_environment

_SCRIPT = Path(__file__).with_name("parse_scenario.py")
_UNITS = frozenset({"kg", "m", "s", "A", "K", "mol", "cd", "rad"})
"""Words of the language that look like names."""
_LONGEST = 60
"""Time limit for parsing [s]."""

_log = logging.getLogger(__name__)


def check_syntax(scenario: Path) -> None:
    """Parse a scenario, if scenario-execution is installed on this machine.

    Only the syntax is checked, since imports may exist only in a container's image. Parsing takes
    longer than all else that a command does before it answers: what was parsed once is remembered
    by its content.

    Raises:
        DocumentError: the scenario cannot be parsed.
    """
    environment = existing_environment()
    if environment is None:
        return
    python = environment / "bin" / "python"
    cache = ContentCache(name="parsed-scenarios")
    key = cache.key([_SCRIPT, scenario], str(python), _installed(environment))
    with suppress(OSError):  # a cache that cannot be read is as good as none
        if cache.get(key) is not None:
            return
    if _parses(python, scenario):
        with suppress(OSError, StorageError):
            cache.put(key, scenario)


def _installed(environment: Path) -> int:
    """When scenario-execution was installed."""
    return (environment / "bin" / "scenario_execution").stat().st_mtime_ns


def _parses(python: Path, scenario: Path) -> bool:
    """Whether a scenario was parsed; False if that cannot be tried.

    Raises:
        DocumentError: it cannot be parsed.
    """
    command = [str(python), str(_SCRIPT), str(scenario)]
    try:
        result = subprocess.run(
            command, capture_output=True, text=True, timeout=_LONGEST, check=True
        )
        mistake: dict[str, Any] | None = json.loads(result.stdout)
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        _log.debug("the scenario cannot be checked: %s", error)
        return False
    if mistake:
        raise DocumentError([_problem(scenario, **mistake)])
    return True


def _problem(scenario: Path, line: int, column: int, found: str | None) -> Problem:
    text = read_text(scenario).splitlines()[line - 1 : line]
    remedy = f"The line is: `{text[0].strip()}`" if text and text[0].strip() else ""
    return Problem(Place(scenario, line, column), "", _meaning(found), remedy)


def _meaning(found: str | None) -> str:
    if found is None:
        what = "this sign does not fit here, or a text has no end or contains a quotation mark"
    elif not found.strip():
        what = "the line ends too early" if "\n" in found else "the line is indented too far"
    else:
        what = "the file ends too early" if found == "<EOF>" else f"`{found}` does not fit here"
        if found in _UNITS:
            what = f"`{found}` is a unit and cannot be a name; choose another name"
    return f"the scenario cannot be parsed: {what}"
