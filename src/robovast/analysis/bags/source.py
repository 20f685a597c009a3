"""What all kinds of bag files have in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from robovast.analysis.bags.definitions import Definition

Consumer = Callable[[int, bytes], None]
"""Takes a message: when it was received [ns], and its bytes as they are in the bag."""

Warn = Callable[[str], None]


@dataclass(frozen=True)
class Topic:
    """A topic of a bag."""

    name: str
    definition: Definition
    """Of its messages."""
    serialization: str = "cdr"

    @property
    def type(self) -> str:
        """Full name of its message type."""
        return self.definition.type


Subscribe = Callable[[Topic], Consumer | None]
"""Says who takes the messages of a topic; None when nobody does."""
