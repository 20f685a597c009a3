"""One class name stands for one thing in the whole code base."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[3]
SOURCES = ("src", "operator", "cli")
GRAMMAR_RULES = ROOT / "src/robovast/navigation/floorplan/omitted_numbers.py"
"""Its classes must have the names of the rules of a grammar."""


def test_public_class_names_are_unique() -> None:
    found: dict[str, list[str]] = defaultdict(list)
    for folder in SOURCES:
        for path in {*(ROOT / folder).rglob("*.py")} - {GRAMMAR_RULES}:
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    found[node.name].append(str(path.relative_to(ROOT)))
    assert len(found) > 500
    assert {name: places for name, places in found.items() if len(places) > 1} == {}
