"""Converts messages to CSV cells by a function that is compiled for each message type.

A message's cells follow the order of its fields. Their number depends on the message's *shape*: the
lengths of all its sequences, in order. Formatting takes most of a conversion's time, so numbers are
formatted in groups.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from struct import Struct
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import orjson
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from robovast.analysis.bags.definitions import WSTRING, DefinitionError, is_wstring

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc, Typesdict

Shape = tuple[int, ...]
Flatten = Callable[[bytes, list[bytes]], Shape]
"""Appends the cells of a message (CDR without its 4-byte header); returns the message's shape."""

_CODES = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
_MOST_VALUES = 1 << 20
"""Most values of a message in sequences; each is a column."""
_TOO_MANY = f"raise ValueError('more than {_MOST_VALUES:,} values')"
_TEXTS = ("string", WSTRING)
_PLACEHOLDER = "structure_needs_at_least_one_member"
"""Placeholder that IDL puts into messages without fields."""
_NEEDS_QUOTES = re.compile(rb'[",\r\n]').search


def text_cell(raw: bytes) -> bytes:
    """Text as one CSV cell; bytes that are not UTF-8 are written as `\\xNN`."""
    if not raw.isascii():
        raw = raw.decode("utf-8", "backslashreplace").encode()
    return b'"' + raw.replace(b'"', b'""') + b'"' if _NEEDS_QUOTES(raw) else raw


def _from_utf_16(encoding: str) -> Callable[[bytes], bytes]:
    return lambda raw: raw.decode(encoding, "replace").rstrip("\0").encode()


_FROM_UTF_16 = {"<": _from_utf_16("utf-16-le"), ">": _from_utf_16("utf-16-be")}


def number_text(values: Any) -> bytes:
    """Comma-separated numbers (a tuple or an array); `nan`, `inf`, `-inf` if not finite."""
    text = orjson.dumps(values, option=orjson.OPT_SERIALIZE_NUMPY)[1:-1]
    if b"null" not in text:
        return text
    numbers = np.asarray(values, dtype=np.float64)
    missing = [repr(value).encode() for value in numbers[~np.isfinite(numbers)].tolist()]
    parts = zip(text.split(b"null"), [*missing, b""], strict=True)
    return b"".join(chain.from_iterable(parts))


def number_cells(values: Any) -> list[bytes]:
    """A cell for each number."""
    return number_text(values).split(b",") if len(values) else []


def bool_cells(values: Any) -> list[bytes]:
    """One cell for truth values, as `True` and `False`."""
    return [b"True" if value else b"False" for value in values]


def seconds_cell(nanoseconds: int) -> bytes:
    """A time [ns] in seconds, without rounding."""
    sign = b"-" if nanoseconds < 0 else b""
    return b"%s%d.%09d" % (sign, *divmod(abs(nanoseconds), 1_000_000_000))


def array_cell(values: NDArray[Any]) -> bytes:
    """One cell for an array (not empty), whose columns are sorted by name."""
    ordered = values[_sorted_places(len(values))]
    return b",".join(bool_cells(ordered)) if ordered.dtype == bool else number_text(ordered)


@lru_cache(maxsize=8)
def _sorted_places(count: int) -> NDArray[np.int64]:
    """Indexes 0 to n - 1, sorted by the names `[0]` to `[n - 1]`."""
    return np.array(sorted(range(count), key="{}]".format))


@dataclass(frozen=True)
class _Field:
    name: str
    of: str
    """A message type, a key of `_CODES`, or one of `_TEXTS`."""
    base: bool
    count: int | None
    """Length of a fixed array; None for anything else."""
    sequence: bool


def _fields(type_: str, types: Typesdict) -> Iterator[_Field]:
    if type_ not in types:
        raise DefinitionError(f"{type_} is not defined")
    for name, description in types[type_][1]:
        if name != _PLACEHOLDER:
            yield _field(name, description)


def _field(name: str, description: FieldDesc) -> _Field:
    kind, what = cast("tuple[Nodetype, Any]", description)
    if kind is Nodetype.NAME:
        wide = is_wstring(what)
        return _Field(name, WSTRING if wide else what, wide, None, False)
    if kind is Nodetype.BASE:
        return _Field(name, what[0], True, None, False)
    element, count = what
    inner = _field(name, element)
    sequence = kind is Nodetype.SEQUENCE
    return replace(inner, count=None if sequence else count, sequence=sequence)


def columns_of(type_: str, types: Typesdict, shape: Shape) -> list[list[str]]:
    """Column names of each cell of a message with this shape.

    A name is the path to a field, such as `a.b[0].c`. All numbers of a sequence form one cell.
    """
    return list(_columns(type_, types, iter(shape), ""))


def _columns(
    type_: str, types: Typesdict, lengths: Iterator[int], prefix: str
) -> Iterator[list[str]]:
    for field in _fields(type_, types):
        path = f"{prefix}.{field.name}" if prefix else field.name
        count = next(lengths) if field.sequence else field.count
        if field.sequence and field.base and field.of not in _TEXTS:
            if count:
                yield [f"{path}[{place}]" for place in _sorted_places(count).tolist()]
            continue
        for item in [path] if count is None else (f"{path}[{place}]" for place in range(count)):
            if field.base:
                yield [item]
            else:
                yield from _columns(field.of, types, lengths, item)


def compile_flatten(type_: str, types: Typesdict, big_endian: bool = False) -> Flatten:
    """Compile the function that flattens messages of a type.

    The function raises ValueError, IndexError or struct.error for invalid messages.

    Raises:
        DefinitionError: the type uses an undefined or unsupported type.
    """
    compiler = _Compiler(types, ">" if big_endian else "<")
    compiler.message(type_)
    return compiler.function()


class _Compiler:
    """Generates the source of a flattening function.

    Its variables are the message `b`, the offset `o`, the cells `c` and the shape `s`. During
    generation the offset is known to be `residue` modulo `modulus`, which determines most padding.
    """

    def __init__(self, types: Typesdict, order: str) -> None:
        self.types = types
        self.order = order
        self.lines = ["def flatten(b, c):", " o = 0", " s = []"]
        self.indent = 1
        self.run: list[str] = []
        self.group = ""
        self.modulus, self.residue = 8, 0
        self.scope: dict[str, Any] = {
            "array": np.frombuffer,
            "array_cell": array_cell,
            "bool_cells": bool_cells,
            "number_cells": number_cells,
            "text_cell": text_cell,
            "wide_text": _FROM_UTF_16[order],
            "length": Struct(f"{order}I").unpack_from,
        }

    def function(self) -> Flatten:
        """Compile the generated source."""
        self.flush()
        self.emit("if o > len(b) or o + 3 < len(b): raise ValueError('wrong size')")
        self.emit(f"if sum(s) > {_MOST_VALUES}: {_TOO_MANY}")
        self.emit("return tuple(s)")
        exec("\n".join(self.lines), self.scope)  # noqa: S102
        return cast("Flatten", self.scope["flatten"])

    def emit(self, line: str) -> None:
        self.lines.append(" " * self.indent + line)

    def constant(self, value: Any) -> str:
        name = f"k{len(self.scope)}"
        self.scope[name] = value
        return name

    def message(self, type_: str) -> None:
        fields = list(_fields(type_, self.types))
        if not fields:
            self.skip(1)  # an empty struct takes one byte
        for field in fields:
            self.field(field)

    def field(self, field: _Field) -> None:
        if field.base and field.of not in {*_TEXTS, *_CODES}:
            raise DefinitionError(f"fields of type {field.of} are not supported")
        if field.sequence:
            self.sequence(field)
        elif field.base and field.of not in _TEXTS:
            self.numbers(field.of, 1 if field.count is None else field.count)
        elif field.count is None:
            self.element(field)
        else:
            self.loop(str(field.count), field)

    def element(self, field: _Field) -> None:
        if field.base:
            self.text(field.of)
        else:
            self.message(field.of)

    def loop(self, count: str, field: _Field) -> None:
        self.flush()
        self.emit(f"for _ in range({count}):")
        self.indent += 1
        self.modulus, self.residue = 1, 0
        self.emit(f"if len(c) > {_MOST_VALUES}: {_TOO_MANY}")
        self.element(field)
        self.flush()
        self.indent -= 1
        self.modulus, self.residue = 1, 0

    def sequence(self, field: _Field) -> None:
        self.read_length()
        self.emit("s.append(n)")
        if not field.base or field.of in _TEXTS:
            # Every element takes at least one byte; a damaged length may be anything.
            self.emit("if n > len(b): raise ValueError('wrong length')")
            self.loop("n", field)
            return
        self.emit(f"if n > {_MOST_VALUES}: {_TOO_MANY}")
        code = _CODES[field.of]
        size = np.dtype(code).itemsize
        values = self.array(code, "n")
        self.emit("if n:")
        self.indent += 1
        self.emit(f"o = (o + {size - 1}) & -{size}")
        self.emit(f"c.append(array_cell({values}))")
        self.emit(f"o += n * {size}")
        self.indent -= 1
        self.modulus, self.residue = min(size, 4), 0

    def array(self, code: str, count: str) -> str:
        """An expression for an array in native byte order."""
        source = self.constant(np.dtype(f"{self.order}{code}"))
        native = self.constant(np.dtype(code))
        return f"array(b, {source}, {count}, o).astype({native}, copy=False)"

    def text(self, kind: str) -> None:
        self.read_length()
        if kind == WSTRING:
            self.emit("n *= 2")
            self.emit("c.append(text_cell(wide_text(b[o : o + n])))")
        else:
            self.emit("c.append(text_cell(b[o : o + n - 1]) if n else b'')")
        self.emit("o += n")
        self.modulus, self.residue = 1, 0

    def read_length(self) -> None:
        self.flush()
        self.align(4)
        self.emit("n, = length(b, o)")
        self.skip(4)

    def numbers(self, base: str, count: int) -> None:
        """Collect fixed-size values, so that one call reads and formats many of them."""
        code = _CODES[base]
        size = Struct(f"<{code}").size
        group = code if code in "f?" else "n"
        if group != self.group or size > self.modulus:
            self.flush()
            self.align(size)
            self.group = group
        padding = -self.residue % size
        self.run.append(f"{padding}x{count}{code}")
        self.residue = (self.residue + padding + size * count) % self.modulus

    def flush(self) -> None:
        """Generate code for the collected values."""
        if not self.run:
            return
        layout = Struct(self.order + "".join(self.run))
        if self.group == "f":
            values = self.array("f", str(layout.size // 4))
        else:
            values = f"{self.constant(layout.unpack_from)}(b, o)"
        self.emit(f"c += {'bool' if self.group == '?' else 'number'}_cells({values})")
        self.emit(f"o += {layout.size}")
        self.run = []
        self.group = ""

    def align(self, size: int) -> None:
        """Generate code that aligns the offset."""
        if size <= self.modulus:
            if self.residue % size:
                self.skip(-self.residue % size)
            return
        self.emit(f"o = (o + {size - 1}) & -{size}")
        self.modulus, self.residue = size, 0

    def skip(self, count: int) -> None:
        self.flush()
        self.emit(f"o += {count}")
        self.residue = (self.residue + count) % self.modulus
