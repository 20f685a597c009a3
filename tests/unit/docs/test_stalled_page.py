"""The page about stalled campaigns lists each reason that the operator gives."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from support.pages import ROOT

PAGES = ("stalled-campaigns.md", "queues.md")
OTHER = {"Expanding", "FailFast", "Queued", "Requeued"}
"""Reasons that no condition `Stalled` has: of other conditions, or of campaigns that wait."""
TABLES = {"_WAITING", "_EXITS"}
"""Names of tables from states of containers to reasons."""


def reasons(tree: ast.AST) -> Iterator[str]:
    """Yield the reasons of problems that a module creates or stores in a table."""
    for node in ast.walk(tree):
        found: list[ast.expr] = []
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            place = {"Trouble": 0, "Waiting": 1}.get(node.func.id)
            found = [] if place is None else node.args[place : place + 1]
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict):
            named = {name.id for name in node.targets if isinstance(name, ast.Name)}
            found = node.value.values if named & TABLES else []
        yield from (
            str(value.value)
            for one in found
            for value in ast.walk(one)
            if isinstance(value, ast.Constant) and re.fullmatch(r"([A-Z]\w+)", str(value.value))
        )


def test_each_reason_is_on_the_page() -> None:
    modules = (ROOT / "operator/robovast_operator").rglob("*.py")
    given = {reason for m in modules for reason in reasons(ast.parse(m.read_text()))}
    text = "".join((ROOT / "docs/how-to" / page).read_text(encoding="utf-8") for page in PAGES)
    named = set(re.findall(r"`([A-Z][A-Za-z]+)`", text))
    assert len(given) > 25
    assert sorted(given - named - OTHER) == []
    assert given >= OTHER
