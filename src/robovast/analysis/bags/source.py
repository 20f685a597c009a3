"""Types shared by all readers of bag files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from robovast.analysis.bags.definitions import Definition

Consumer = Callable[[int, bytes], None]
"""Receives a message: time of receipt [ns], and its bytes in the bag."""

Warn = Callable[[str], None]


@dataclass(frozen=True)
class Topic:
    """A topic of a bag."""

    name: str
    definition: Definition
    """Serialization of its messages."""
    serialization: str = "cdr"

    @property
    def type(self) -> str:
        """Full name of the message type."""
        return self.definition.type


Subscribe = Callable[[Topic], Consumer | None]
"""Returns the consumer of a topic's messages, or None."""
