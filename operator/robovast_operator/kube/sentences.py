"""Form sentences from texts of other programs, for conditions and Events. Pure functions."""

from __future__ import annotations

import re

_PERIOD = re.compile(r"(?<![./\s])\.+$|^[.\s]+$")
"""The period of a sentence, not of a path such as `..` or `/data/.`."""


def clause(text: str) -> str:
    """Return a text without the period at its end, for the middle of a sentence."""
    return _PERIOD.sub("", text.strip()) or "the cause is unknown"


def after_colon(text: str) -> str:
    """Return a colon and a cause; an empty string if there is no cause."""
    return f": {clause(text)}" if text.strip(". \n") else ""


def sentence(text: str, lead: str = "") -> str:
    """Return a text that ends with a period.

    Args:
        text: of an error or of another program.
        lead: beginning of the sentence if the text does not begin with a capital letter.
    """
    found = clause(text)
    if found.partition(" ")[0] in _WORDS:
        found = found[0].upper() + found[1:]
    return f"{found if found[0].isupper() else lead + found}."


_WORDS = frozenset({"a", "all", "an", "each", "no", "the", "there", "this"})
"""Words that may begin a sentence; other texts may begin with the name of a file or key."""


def with_remedy(lead: str, problems: str, remedy: str) -> str:
    """Return a sentence with the problems that were found, and a sentence with the remedy.

    Args:
        lead: what is wrong, without a period.
        problems: one a line.
        remedy: a sentence.
    """
    if "\n" in problems.strip():
        return f"{lead}:\n{problems.strip()}\n{remedy}"
    return f"{lead}: {clause(problems)}. {remedy}"
