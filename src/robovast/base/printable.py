"""Makes untrusted text safe for terminals: names, reasons, logs, answers."""

from __future__ import annotations

import logging
import re

_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Characters that terminals interpret, or that cannot be encoded as UTF-8."""


def printable(text: str) -> str:
    """The text with control characters written as `\\x1b`; lines are kept."""
    return _UNSEEN.sub(lambda found: ascii(found[0])[1:-1], text)


def printable_json(text: str) -> str:
    """JSON of the same data with control characters, which only its texts have, as `\\u001b`."""
    return _UNSEEN.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def one_line(text: str) -> str:
    """Like `printable`, in one line."""
    return printable(text).replace("\n", "⏎")


def is_printable(name: str) -> bool:
    """Whether a name is printed unchanged in one line."""
    return one_line(name) == name


class PrintableFormatter(logging.Formatter):
    """Formats log records as printable text."""

    def format(self, record: logging.LogRecord) -> str:
        """The text of a record."""
        return printable(super().format(record))
