"""The form of messages in conditions and Events."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from typing import Any

_REASON = re.compile(r"[A-Z][A-Za-z0-9]+")
_PRONOUN = re.compile(r"(^|[.!?]\s+)(It|Its|They|This|That|These)\b")


def faults_of(reason: str, message: str) -> list[str]:
    """Return what is wrong with the form of a condition or an Event; an empty message is right."""
    rules = {
        "the reason is not CamelCase": bool(_REASON.fullmatch(reason)),
        "the first letter is no capital": message[:1].isupper() or message[:1].isdigit(),
        "the last character is no period": message.endswith("."),
        "a sentence begins with a pronoun": not _PRONOUN.search(message),
    }
    if not message:
        rules = dict(list(rules.items())[:1])
    return [fault for fault, right in rules.items() if not right]


class Watch:
    """Collects the faults of messages that a package makes."""

    def __init__(self, package: str, limit: int) -> None:
        """Watch the modules of a package; longer messages are cut, and have no end."""
        self._package = package
        self._limit = limit
        self._foreign: set[str] = set()
        self.faults: list[str] = []

    def on(self, kind: type, text: str = "message") -> Callable[..., None]:
        """Return the `__init__` of a class of messages that looks at what is made."""
        init: Callable[..., None] = kind.__init__  # type: ignore[misc]

        def made(instance: Any, *args: Any, **kwargs: Any) -> None:
            init(instance, *args, **kwargs)
            message = getattr(instance, text)
            if _maker().startswith(self._package):
                self.look(instance.reason, message)
            elif message:
                self._foreign.add(message)

        return made

    def look(self, reason: str, message: str) -> None:
        """Look at a message, unless a test has made a part of it."""
        if len(message) < self._limit and not any(text in message for text in self._foreign):
            self.faults += [f"{fault}: {reason}: {message}" for fault in faults_of(reason, message)]


def _maker() -> str:
    """Return the name of the module that makes an instance of a dataclass."""
    frame = sys._getframe(2)
    while frame.f_globals.get("__name__") == "dataclasses" and frame.f_back is not None:
        frame = frame.f_back
    return str(frame.f_globals.get("__name__"))
