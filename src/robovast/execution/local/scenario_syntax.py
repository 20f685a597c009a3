"""Checks the syntax of a scenario before any run fails because of it."""

from __future__ import annotations

import json
import logging
import subprocess
from pathlib import Path
from typing import Any

from robovast.base.errors import DocumentError, Place, Problem
from robovast.execution.local.process_environment import existing_environment

_SCRIPT = Path(__file__).with_name("parse_scenario.py")
_LONGEST = 60
"""Time limit for parsing [s]."""

_log = logging.getLogger(__name__)


def check_syntax(scenario: Path) -> None:
    """Parse a scenario, if scenario-execution is installed on this machine.

    Only the syntax is checked, since imports may exist only in a container's image.

    Raises:
        DocumentError: the scenario cannot be parsed.
    """
    environment = existing_environment()
    mistake = _first_mistake(environment, scenario) if environment else None
    if mistake:
        raise DocumentError([_problem(scenario, **mistake)])


def _first_mistake(environment: Path, scenario: Path) -> dict[str, Any] | None:
    command = [str(environment / "bin" / "python"), str(_SCRIPT), str(scenario)]
    try:
        result = subprocess.run(
            command, capture_output=True, text=True, timeout=_LONGEST, check=True
        )
        mistake: dict[str, Any] | None = json.loads(result.stdout)
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        _log.debug("the scenario cannot be checked: %s", error)
        return None
    return mistake


def _problem(scenario: Path, line: int, column: int, found: str | None) -> Problem:
    text = scenario.read_text(encoding="utf-8").splitlines()[line - 1 : line]
    remedy = f"The line is: `{text[0].strip()}`" if text and text[0].strip() else ""
    return Problem(Place(scenario, line, column), "", _meaning(found), remedy)


def _meaning(found: str | None) -> str:
    if found is None:
        what = "this sign does not fit here, or a text has no end"
    elif not found.strip():
        what = "the line ends too early" if "\n" in found else "the line is indented too far"
    else:
        what = "the file ends too early" if found == "<EOF>" else f"`{found}` does not fit here"
    return f"the scenario cannot be parsed: {what}"
