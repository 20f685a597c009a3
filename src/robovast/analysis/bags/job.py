"""Interface of the workers that execute bag commands, and their context."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from robovast.analysis.bags.definitions import Definition, types_of, typestore_of
from robovast.analysis.bags.flatten import Flatten, Shape, columns_of, compile_flatten
from robovast.analysis.bags.source import Consumer, Topic, Warn
from robovast.analysis.bags.table import Columns, CsvTable, no_columns

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict

_LITTLE, _BIG = b"\x00\x01", b"\x00\x00"


@dataclass(frozen=True)
class Context:
    """The bag and the output of a worker."""

    bag: Path
    folder: Path
    """Output folder."""
    warn: Warn
    definitions: Path | None
    """Folder with message definitions that the bag may lack."""
    distribution: str
    """ROS distribution of the recorder, such as `jazzy`; empty if unknown."""
    topics: dict[str, str]
    """Type of each topic in the bag's metadata."""
    window: tuple[int, int] | None = None
    """From when to when the run took place [ns], where the bag is of several runs."""

    def table(
        self,
        name: str,
        leading: Sequence[str],
        columns: Columns = no_columns,
        title: Callable[[str], str] | None = None,
    ) -> CsvTable:
        """A CSV file; see `Table`."""
        path = self.folder / name
        return CsvTable(path, leading, columns, title)

    def types(self, definition: Definition) -> Typesdict:
        """Fields of a message type and of all types it uses."""
        return types_of(definition, self.definitions, self.distribution)

    def reader(self, topic: Topic) -> Callable[[bytes], object]:
        """A function that deserializes messages."""
        store = typestore_of(topic.definition, self.definitions, self.distribution)
        type_ = topic.type
        return lambda data: store.deserialize_cdr(data, type_)

    def flattener(self, topic: Topic) -> Flatten:
        """A function that appends the cells of a raw message and returns its shape."""
        return _flattener(topic.definition, self.definitions, self.distribution)

    def columns(self, topic: Topic, shape: Shape) -> list[list[str]]:
        """Column names of each cell of a message with this shape."""
        return columns_of(topic.type, self.types(topic.definition), shape)


class JobWorker(Protocol):
    """A job in progress on one bag."""

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of a topic's messages, or None; called again for each file of the bag.

        Raises:
            DefinitionError: the topic's messages cannot be decoded.
        """

    def finish(self) -> list[Path]:
        """Complete the files and return them."""

    def discard(self) -> None:
        """Remove unfinished files."""


def nothing_on(context: Context, what: str) -> str:
    """The warning that there are no messages on a topic, or of a type."""
    known = f"; it has {', '.join(sorted(context.topics))}" if context.topics else ""
    return f"{context.bag.name} has no message on {what}{'' if what in context.topics else known}"


@lru_cache(maxsize=512)
def _flattener(definition: Definition, folder: Path | None, distribution: str) -> Flatten:
    types = types_of(definition, folder, distribution)
    little = compile_flatten(definition.type, types)
    big = compile_flatten(definition.type, types, big_endian=True)

    def flatten(data: bytes, cells: list[bytes]) -> Shape:
        order = data[:2]
        if order == _LITTLE:
            return little(data[4:], cells)
        if order == _BIG:
            return big(data[4:], cells)
        raise ValueError("unknown encapsulation")

    return flatten
