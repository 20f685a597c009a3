"""Messages of conditions and Events are sentences, wherever the operator makes them.

The fixture of `conftest.py` checks the messages that unit tests make. This test reads the source,
because some messages are made in no unit test.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest
from support.sentences import Watch, faults_of

import robovast_operator
from robovast.base.errors import with_hint
from robovast_operator.kube.sentences import after_colon, clause, sentence, with_remedy
from robovast_operator.pods.observations import Trouble

ROOT = Path(robovast_operator.__file__).parent
MAKERS = {
    "Trouble": 1,
    "Rejected": 1,
    "Waiting": 2,
    "Mishap": 2,
    "EventContent": 2,
    "InputError": 0,
    "TooLargeError": 0,
}
"""What has a message, and the position of the message among the arguments."""
TRUTHS = {"True", "False", "Unknown"}
GAP = "\0"
"""Stands for a value in a message."""
KEPT = {"sentence", "one_line"}
"""Functions that return the first argument with another form."""

Names = Mapping[str, Sequence[ast.expr]]


def choices(found: ast.expr, names: Names) -> Sequence[ast.expr]:
    """Return the expressions of which an expression has one value; none if it has its own."""
    match found:
        case ast.IfExp(body=body, orelse=other):
            return [body, other]
        case ast.BoolOp(values=values):
            return values
        case ast.Name(id=name):
            return names.get(name, [])
        case ast.Call(func=ast.Name(id=name), args=[first, *_]) if name in KEPT:
            return [first]
        case ast.FormattedValue(value=ast.Name() as value):
            return [value]
    return []


def texts(found: ast.expr, names: Names, depth: int = 8) -> Iterator[str]:
    """Generate the texts that an expression may have, with gaps for values."""
    match found:
        case ast.Constant(value=str(text)):
            yield text
        case ast.JoinedStr(values=parts):
            yield from joined(parts, names, depth)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            yield from joined([left, right], names, depth)
        case ast.Call(func=ast.Attribute(value=text, attr="format")):
            yield from (re.sub(r"\{\w*\}", GAP, each) for each in texts(text, names, depth))
        case _:
            others = choices(found, names) if depth else ()
            for other in others:
                yield from texts(other, names, depth - 1)
            if not others:
                yield GAP


def joined(parts: Sequence[ast.expr], names: Names, depth: int) -> Iterator[str]:
    """Generate the texts that parts have together; of the parts inside, one text each."""
    firsts = [*texts(parts[0], names, depth)] if parts else [""]
    lasts = [*texts(parts[-1], names, depth)] if len(parts) > 1 else [""]
    middle = "".join(next(texts(part, names, depth), GAP) for part in parts[1:-1])
    yield from (first + middle + last for first in firsts for last in lasts)


def names_in(nodes: Sequence[ast.AST]) -> dict[str, list[ast.expr]]:
    """Return what assignments give to names."""
    found: dict[str, list[ast.expr]] = {}
    for node in nodes:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            found.setdefault(node.targets[0].id, []).append(node.value)
    return found


def made_in(scope: Sequence[ast.AST], names: Names) -> Iterator[tuple[str, str]]:
    """Generate reason and text of the messages that a scope makes."""
    for node in scope:
        match node:
            case ast.Call(func=ast.Name(id=name), args=args) if len(args) > MAKERS.get(name, 99):
                at = MAKERS[name]
                reason, message = args[at - 1] if at else ast.Constant("Invalid"), args[at]
            case ast.Tuple(elts=[_, ast.Constant(value=truth), reason, message]):
                if truth not in TRUTHS:
                    continue
            case _:
                continue
        whys = [why for why in texts(reason, names) if GAP not in why] or ["Known"]
        hints = [text for hint in hints_of(node) for text in texts(hint, names)] or [""]
        found = {with_hint(text, hint) for text in texts(message, names) for hint in hints}
        yield from ((why, text) for text in found for why in whys)


def hints_of(node: ast.AST) -> Iterator[ast.expr]:
    """Generate the hint of an error, which is the end of its message in a condition."""
    if isinstance(node, ast.Call):
        yield from (keyword.value for keyword in node.keywords if keyword.arg == "hint")


def messages_of(source: str) -> set[tuple[str, str]]:
    """Return reason and text of the messages that a module makes."""
    tree = ast.parse(source)
    top = [node for node in tree.body if not isinstance(node, ast.FunctionDef | ast.ClassDef)]
    module = names_in(top)
    found = set(made_in([inner for node in top for inner in ast.walk(node)], module))
    for scope in ast.walk(tree):
        if isinstance(scope, ast.FunctionDef | ast.AsyncFunctionDef):
            nodes = list(ast.walk(scope))
            found |= set(made_in(nodes, {**module, **names_in(nodes)}))
    return {(why, text) for why, text in found if text not in {"", GAP}}


def faults_in(source: str) -> Iterator[str]:
    """Generate the faults of the messages that a module makes."""
    for why, text in sorted(messages_of(source)):
        # A gap is a word or two; whether it begins or ends the message well, a test run shows.
        begun, whole = text.replace(GAP, "X", 1) if text.startswith(GAP) else text, text
        begun += "." if whole.endswith(GAP) else ""
        faults = faults_of(why, begun.replace(GAP, "x"))
        if re.search(r"\b[Ii]ts?\b", whole):
            faults.append("a pronoun stands for the noun")
        yield from (f"{fault}: {why}: {whole}" for fault in faults)


@pytest.mark.parametrize("path", sorted(ROOT.rglob("*.py")), ids=lambda p: str(p.relative_to(ROOT)))
def test_every_message_in_the_source_is_a_sentence(path: Path) -> None:
    assert list(faults_in(path.read_text())) == []


def test_the_source_has_the_messages_that_are_looked_for() -> None:
    found = {text for path in ROOT.rglob("*.py") for _, text in messages_of(path.read_text())}
    assert len(found) > 80
    assert any(text.startswith("Kueue has no WorkloadPriorityClass") for text in found)


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ('Trouble("Lost", "the node is lost.")', "the first letter is no capital"),
        ('Trouble("Lost", f"Node {node} is lost")', "the last character is no period"),
        ('Trouble("lost pod", "Node is lost.")', "the reason is not CamelCase"),
        ('("Stalled", "True", "Lost", "It is lost.")', "a sentence begins with a pronoun"),
        ('Trouble("Lost", why or "The node lost its pod.")', "a pronoun stands for the noun"),
        ('EventContent("Normal", "Lost", a if a else "no", "x")', "the first letter is no capital"),
    ],
)
def test_a_message_without_the_form_is_found(line: str, fault: str) -> None:
    found = list(faults_in(f"def f(node, why, a):\n    return {line}\n"))
    assert [text.partition(":")[0] for text in found][:1] == [fault]


def test_a_message_without_the_form_is_found_when_it_is_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch = Watch(__name__.partition(".")[0], 100)
    monkeypatch.setattr(Trouble, "__init__", watch.on(Trouble))
    Trouble("NodeLost", "Node n1 is lost.")
    assert watch.faults == []
    Trouble("NodeLost", "node n1 is lost")
    assert [fault.partition(":")[0] for fault in watch.faults] == [
        "the first letter is no capital",
        "the last character is no period",
    ]


def test_texts_of_others_become_sentences() -> None:
    assert clause("no space left. \n") == "no space left"
    assert clause("") == "the cause is unknown"
    assert after_colon("gone.") == ": gone"
    assert after_colon(" . ") == ""
    assert sentence("drive.vast:1: no", "Invalid: ") == "Invalid: drive.vast:1: no."
    assert sentence("The disk is full.", "Invalid: ") == "The disk is full."
    assert with_remedy("Wrong", "a", "Fix a.") == "Wrong: a. Fix a."
    assert with_remedy("Wrong", "a\nb", "Fix both.") == "Wrong:\na\nb\nFix both."
