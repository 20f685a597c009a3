"""What a command reports as data to the program that started it, such as the web UI.

Its output is for people; a program that searched it for names would find names of other things.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

VARIABLE = "ROBOVAST_TASK_RECORD"
"""Environment variable with the path of the record; without it, nothing is reported."""


def report(**facts: str) -> None:
    """Append facts to the record, if another program asked for one."""
    if path := os.environ.get(VARIABLE):
        with suppress(OSError), open(path, "a", encoding="utf-8") as record:
            record.write(json.dumps(facts) + "\n")


def read_facts(path: Path) -> dict[str, str]:
    """All facts that were reported; of several with one name, the first."""
    found: dict[str, str] = {}
    for facts in _facts(path):
        found = {**facts, **found}
    return found


def _facts(path: Path) -> Iterator[dict[str, str]]:
    with suppress(OSError, ValueError):  # the last line may be incomplete
        for line in path.read_text("utf-8").splitlines():
            yield json.loads(line)
