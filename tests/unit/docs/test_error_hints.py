"""Errors have the form of the style guide: the message has the cause, the hint has the remedy."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache

import pytest
from support.command_tree import commands
from support.pages import ROOT

FOLDERS = ("src", "cli", "operator")
VERBS = (
    "add|ask|check|choose|convert|copy|correct|create|decompress|delete|divide|do not|download|"
    "exclude|export|fix|free|give|group|increase|install|let|log in|lower|move|name|narrow|open|"
    "pack|pass|publish|put|query|raise|record|remove|rename|repeat|replace|restore|run|save|"
    "select|send|set|simplify|split|try|unpack|update|upload|use|wait|write"
)
REMEDY = re.compile(rf"[.:;?!] +(?:or |then |please )?(?:{VERBS})\b|\?(?!`)", re.IGNORECASE)
"""A second sentence or clause that begins with an imperative, or a question."""
COMMAND = re.compile(r"`vast ([a-z][a-z -]*)")
GAP = "\0"
"""Stands for a value in a text."""

Site = tuple[str, str, str | None]
"""Place, message and hint of an error."""


def text_of(node: ast.expr | None) -> str:
    """Return a text with gaps for its values."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(map(text_of, parts))
        case ast.IfExp(body=body, orelse=other):
            return max(text_of(body), text_of(other), key=len)
    return GAP


def errors(trees: list[ast.Module]) -> set[str]:
    """Return the names of all subclasses of RobovastError."""
    classes = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    found, before = {"RobovastError"}, 0
    while len(found) > before:
        before = len(found)
        for node in classes:
            if any(isinstance(base, ast.Name) and base.id in found for base in node.bases):
                found.add(node.name)
    return found


@cache
def sites() -> list[Site]:
    """Return all places of the source that make an error with a message."""
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in paths}
    kinds = errors(list(trees.values()))
    return [
        (f"{path.relative_to(ROOT)}:{site[0]}", site[1], site[2])
        for path, tree in trees.items()
        for site in sites_in(tree, kinds)
    ]


def sites_in(tree: ast.AST, kinds: set[str]) -> Iterator[tuple[int, str, str | None]]:
    """Generate line, message and hint of the errors that a module makes."""
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id=name), args=[first, *_]) if name in kinds:
                hints = [text_of(word.value) for word in node.keywords if word.arg == "hint"]
                yield node.lineno, text_of(first), next(iter(hints), None)


def test_a_remedy_is_the_hint_of_an_error() -> None:
    found = [(place, message) for place, message, _ in sites() if REMEDY.search(message)]
    assert found == []


def test_a_hint_is_an_imperative_without_a_period() -> None:
    hints = [(place, hint) for place, _, hint in sites() if hint is not None]
    wrong = [
        (place, hint)
        for place, hint in hints
        if hint.endswith(".")
        or re.match(r"[A-Z][a-z]", hint)
        or ("?" in hint and "mean" not in hint)
    ]
    assert wrong == []
    assert len(hints) > 300


def test_the_commands_of_hints_exist() -> None:
    known = {path for path, _ in commands()}
    named = {
        (place, found[1].strip())
        for place, _, hint in sites()
        for found in COMMAND.finditer(hint or "")
    }
    assert len(named) > 20
    assert [
        (place, words)
        for place, words in sorted(named)
        if not any(words == path or words.startswith(f"{path} ") for path in known)
    ] == []


@pytest.mark.parametrize(
    ("line", "is_remedy"),
    [
        ('InputError("the folder is full. Choose another one.")', True),
        ('InputError(f"{name}: is a link; remove it")', True),
        ('InputError(f"{name}: not a text file: is it the right file?")', True),
        ('InputError("the folder is full. Nothing was written", hint="choose another one")', False),
        ('InputError(f"{name}: cannot be read: {cause}")', False),
    ],
)
def test_a_remedy_is_found(line: str, is_remedy: bool) -> None:
    ((_, message, _),) = sites_in(ast.parse(line), {"InputError"})
    assert bool(REMEDY.search(message)) == is_remedy
