"""Text of others, made safe to print on a terminal: names, reasons, logs, answers."""

from __future__ import annotations

import logging
import re

_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""What a terminal obeys instead of showing it, and what cannot be written as UTF-8."""


def printable(text: str) -> str:
    """The text with escapes and the like as `\\x1b`; lines stay lines."""
    return _UNSEEN.sub(lambda found: ascii(found[0])[1:-1], text)


def one_line(text: str) -> str:
    """As `printable`, in one line."""
    return printable(text).replace("\n", "⏎")


def is_printable(name: str) -> bool:
    """True for a name that is shown as it is, in one line."""
    return one_line(name) == name


class PrintableFormatter(logging.Formatter):
    """Formats what is logged as it can be shown."""

    def format(self, record: logging.LogRecord) -> str:
        """The text of a record."""
        return printable(super().format(record))
