"""Where the files of a campaign are is said in one place."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import robovast

SOURCE = Path(robovast.__file__).parent
NAMES = {SOURCE / "model/naming.py", SOURCE / "campaign/layout.py"}
PATH = re.compile(
    r"(.*/)?(_config|_jobs|_execution|_transient|\.running)(/.*)?"
    r"|(.*/)?(run\.json|test\.xml|configurations\.yaml|execution\.yaml|scenario\.config|data\.db"
    r"|campaign\.db|tables\.duckdb|postprocessing\.yaml|sysinfo\.yaml|metadata\.prov\.json)"
)


def _spelled(file: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text())):
        value = node.value if isinstance(node, ast.Constant) else None
        if isinstance(value, str) and PATH.fullmatch(value) and " " not in value:
            yield f"{file.relative_to(SOURCE)}:{node.lineno}: {value}"


def test_paths_of_a_campaign_are_spelled_in_its_layout_alone() -> None:
    files = set(SOURCE.rglob("*.py")) - NAMES - set((SOURCE / "execution/contract").glob("*.py"))
    assert [found for file in sorted(files) for found in _spelled(file)] == []
