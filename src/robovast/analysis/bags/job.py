"""What works on the messages of a bag for one command, and what it is given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from robovast.analysis.bags.definitions import Definition, types_of, typestore_of
from robovast.analysis.bags.flatten import Flatten, Shape, columns_of, compile_flatten
from robovast.analysis.bags.source import Consumer, Topic, Warn
from robovast.analysis.bags.table import Columns, Table, no_columns

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict

_LITTLE, _BIG = b"\x00\x01", b"\x00\x00"


@dataclass(frozen=True)
class Context:
    """The bag that is read, and where results go."""

    bag: Path
    folder: Path
    """Where files are written."""
    warn: Warn
    definitions: Path | None
    """Folder with message definitions that the bag may lack."""
    distribution: str
    """ROS distribution of the recorder, as `jazzy`; empty when unknown."""
    topics: dict[str, str]
    """Type of each topic that the bag's metadata name."""
    window: tuple[int, int] | None = None
    """From when to when the run took place [ns], where the bag is of several runs."""

    def table(
        self,
        name: str,
        leading: Sequence[str],
        columns: Columns = no_columns,
        title: Callable[[str], str] | None = None,
    ) -> Table:
        """A CSV file; see `Table`."""
        path = self.folder / name
        return Table(path, leading, columns, title)

    def types(self, definition: Definition) -> Typesdict:
        """Fields of a message type and of all in it."""
        return types_of(definition, self.definitions, self.distribution)

    def reader(self, topic: Topic) -> Callable[[bytes], object]:
        """What makes an object of a message."""
        store = typestore_of(topic.definition, self.definitions, self.distribution)
        type_ = topic.type
        return lambda data: store.deserialize_cdr(data, type_)

    def flattener(self, topic: Topic) -> Flatten:
        """What appends the cells of a message as it is in the bag, and returns its shape."""
        return _flattener(topic.definition, self.definitions, self.distribution)

    def columns(self, topic: Topic, shape: Shape) -> list[list[str]]:
        """Names of the columns of each cell of a message that has a shape."""
        return columns_of(topic.type, self.types(topic.definition), shape)


class Worker(Protocol):
    """A job at work on one bag."""

    def subscribe(self, topic: Topic) -> Consumer | None:
        """Who takes the messages of a topic; it may be asked again for each file of the bag.

        Raises:
            DefinitionError: the topic is wanted, but its messages cannot be understood.
        """

    def finish(self) -> list[Path]:
        """Complete the files; they are returned."""

    def discard(self) -> None:
        """Leave nothing behind."""


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
