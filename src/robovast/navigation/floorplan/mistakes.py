"""Describes syntax errors in floor plans in terms of their language."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from textx.exceptions import TextXSyntaxError

from robovast.model.document.problems import nearest

_RULES = {
    "Unit": "a unit (mm, cm, m, deg, rad)",
    "STRICTFLOAT": "a number",
    "INT": "a number",
    "ID": "a name",
    "STRING": "a text in quotes",
    "EOF": "the end of the file",
}
_MANY = 5
"""Longer lists of alternatives are not shown."""


def describe_error(error: TextXSyntaxError, text: str) -> tuple[str, str]:
    """What is wrong with a text, and what would be right.

    Args:
        error: what the parser raised.
        text: of the file.
    """
    line = "".join(text.splitlines()[error.line - 1 : error.line])
    found = re.match(r"\w+|\S", line[error.col - 1 :])
    words = list(dict.fromkeys(_words(error)))
    if found is None:
        return f"the file {'ends too early' if text.strip() else 'is empty'}", _remedy(words)
    if "Unit" in words and found[0].isalpha():
        return f"`{found[0]}` is not a valid unit here", "Units are mm, cm, m, deg and rad."
    near = nearest(found[0], [word for word in words if word not in _RULES])
    return (
        f"`{found[0]}` does not fit here",
        f"Did you mean `{near}`?" if near else _remedy(words),
    )


def _remedy(words: Iterable[str]) -> str:
    wanted = list(dict.fromkeys(_RULES.get(word, f"`{word}`") for word in words))
    if not wanted or len(wanted) > _MANY:
        return ""
    *others, last = wanted
    return f"Expected {', '.join(others)} or {last}." if others else f"Expected {last}."


def _words(error: TextXSyntaxError) -> Iterator[str]:
    """Rules and words that could stand at the place; comments could anywhere."""
    for rule in error.expected_rules:
        word = rule.rule_name if rule.rule_name in _RULES else getattr(rule, "to_match", "EOF")
        if not word.startswith(("\\/", "/")):
            yield word
