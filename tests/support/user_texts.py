"""The texts that users read, by area: pages, help, messages, MCP tools, chart, CRDs and web UI."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from support.command_tree import commands
from support.pages import ROOT

# Pages that quote what not to write, and pages whose sources are other areas.
SKIPPED = ("docs/contributing/style.md", "docs/reference/cli/")
CODE = re.compile(r"^ *(```+|~~~+)[^\n]*\n.*?^ *\1 *$", re.DOTALL | re.MULTILINE)
MARKUP = re.compile(r"`[^`\n]*`|<!--.*?-->|(?<=\])\([^)\s]+\)", re.DOTALL)
EXAMPLE = re.compile(r"^ *(?:kubectl )?(?:vast|claude) [^\n]*$", re.MULTILINE)
STATEMENT = re.compile(r"\bSELECT\b|\bimport \w+$|[;{}]$|</|\(\?P<|\$\(cat|^\s*[.#<]", re.MULTILINE)

Text = tuple[str, str]
"""Place and text."""


def pages() -> Iterator[Text]:
    """Yield the pages without blocks of code."""
    found = [*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md"))]
    for page in found:
        place = page.relative_to(ROOT).as_posix()
        if not place.startswith(SKIPPED):
            yield place, CODE.sub("", page.read_text(encoding="utf-8"))


def help_texts() -> Iterator[Text]:
    """Yield the help of each command, argument and option."""
    for path, real in commands():
        yield f"vast {path}", real.help or ""
        for param in real.params:
            yield f"vast {path} {param.name}", getattr(param, "help", None) or ""


def literals(folder: str) -> Iterator[Text]:
    """Yield the literals with words in a folder's modules; docstrings and help are not messages."""
    helps = {" ".join(text.split()) for _, text in help_texts()}
    for module in sorted((ROOT / folder).rglob("*.py")):
        place = module.relative_to(ROOT).as_posix()
        for line, text in _literals(ast.parse(module.read_text(encoding="utf-8"))):
            if (
                re.search(r"[a-z] [a-z]", text)
                and not STATEMENT.search(text)
                and " ".join(text.split()) not in helps
            ):
                yield f"{place}:{line}", text


def _literals(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and text of literals, with X for each value in an f-string."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value
        elif isinstance(node, ast.JoinedStr):
            parts = [part.value if isinstance(part, ast.Constant) else "X" for part in node.values]
            yield node.lineno, "".join(map(str, parts))
            values = [part.value for part in node.values if isinstance(part, ast.FormattedValue)]
            yield from _literals(ast.Tuple(values))
        else:
            yield from _literals(node)


def tools() -> Iterator[Text]:
    """Yield the descriptions of the MCP tools."""
    for module in sorted((ROOT / "src/robovast/mcp").glob("*.py")):
        tree = ast.parse(module.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                place = module.relative_to(ROOT).as_posix()
                yield f"{place}:{node.lineno}", ast.get_docstring(node) or ""


def chart() -> Iterator[Text]:
    """Yield comments of the values, descriptions of the schema, alerts and the release notes."""
    folder = ROOT / "helm/robovast"
    comments = re.findall(r"(?:^ *# .*\n)+", (folder / "values.yaml").read_text(), re.MULTILINE)
    yield from (("values.yaml", re.sub(r"^ *# ", "", text, flags=re.M)) for text in comments)
    yield from _described("values.schema.json", folder / "values.schema.json")
    alerts = (folder / "templates/metrics.yaml").read_text()
    yield "alerts", "\n\n".join(re.findall(r"summary: (.*)", alerts))
    yield "NOTES.txt", re.sub(r"\{\{.*?\}\}", "X", (folder / "templates/NOTES.txt").read_text())


def crds() -> Iterator[Text]:
    """Yield the descriptions of the fields of the CRDs."""
    for path in sorted((ROOT / "crds").glob("*.yaml")):
        yield from _described(path.name, path)


def _described(place: str, path: Path) -> Iterator[Text]:
    return _descriptions(place, yaml.safe_load(path.read_text(encoding="utf-8")))


def _descriptions(place: str, value: Any) -> Iterator[Text]:
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        if key in ("description", "message") and isinstance(inner, str):
            yield place, inner
        elif isinstance(inner, dict | list):
            yield from _descriptions(f"{place} {key}", inner)


def web() -> Iterator[Text]:
    """Yield the literals of the texts of the web UI."""
    source = ROOT / "web/src/text.ts"
    text = source.read_text(encoding="utf-8") if source.is_file() else ""
    for literal in re.findall(r'"((?:[^"\\\n]|\\.)*)"|`((?:[^`\\]|\\.)*)`', text):
        yield "text.ts", "".join(literal)


@cache
def areas() -> dict[str, list[Text]]:
    """Return the texts of each area, with X for names of code, links and commands."""
    found = {
        "pages": pages(),
        "help": help_texts(),
        "cli": literals("cli"),
        "library": literals("src"),
        "operator": literals("operator"),
        "tools": tools(),
        "chart": chart(),
        "crds": crds(),
        "web": web(),
    }
    return {
        area: [(place, MARKUP.sub("X", EXAMPLE.sub("X\n", text))) for place, text in texts]
        for area, texts in found.items()
    }
