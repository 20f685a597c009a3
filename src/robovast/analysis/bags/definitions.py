"""Message definitions: from the bag, from files beside the .vast file, or from ROS.

Bags since ROS 2 Iron contain the definitions of their message types; those of action feedback are
missing before Kilted.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from rosbags.interfaces import Nodetype
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)

from robovast.analysis.bags.nav2_feedback import FEEDBACK
from robovast.base.safe_paths import read_file

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc, Typesdict
    from rosbags.typesys.store import Typestore

_SEPARATOR = "=" * 80
_SECTION = re.compile(rf"^{_SEPARATOR}\n", re.MULTILINE)
_IDL_SEPARATOR = re.compile(rf"^{_SEPARATOR}\nIDL: .*$", re.MULTILINE)
_FEEDBACK, _EVENT = "_FeedbackMessage", "_Event"
_PARTS = re.compile(r"^---\s*$", re.MULTILINE)
"""Separates request and response of a service, or goal, result and feedback of an action."""
_LONGEST_CAUSE = 120
"""Longest quotation of a parser's message, which contains the whole definition [characters]."""
WSTRING = "wstring"
_WSTRING_BOUND = re.compile(rf"^(\s*{WSTRING})<=\d+", re.MULTILINE)
_WSTRING_CONSTANT = re.compile(rf"^[ \t]*{WSTRING}\s+\w+[ \t]*=.*$", re.MULTILINE)
"""What the parser does not know of 16-bit text; neither changes how a message is stored."""


_FAULTS = (
    *(TypesysError, ArithmeticError, AssertionError, AttributeError, LookupError, OSError),
    *(RuntimeError, TypeError, ValueError),
)
"""What the parser raises for invalid definitions."""
_TYPE = re.compile(r"[A-Za-z]\w*(/(msg|srv|action))?/[A-Za-z]\w*", re.ASCII)
_LONGEST = 256 << 10
"""Longest definition [characters]; those of ROS have at most some 30,000."""
_MOST_LEVELS = 64
"""Most levels of types within types."""
_MOST_ITEMS = 1 << 16
"""Most items of an array of fixed length."""
_MOST_FIELDS = 10_000
"""Most values outside of arrays; each becomes a column."""
_MOST_ELEMENTS = 1 << 24
"""Most values of a message, in arrays of fixed length within each other."""
_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*(?:"|\Z)|//[^\n]*|/\*.*?(?:\*/|\Z)', re.DOTALL)
_ANNOTATION = re.compile(r"@\w+\s*\((?:[^()]|\([^()]*\))*\)")
_COMPUTES = re.compile(r"\(|<<|>>\s*[0-9]")
"""Parts of expressions in IDL, whose parser takes exponential time or memory for some; the
definitions that ROS writes have none."""


class DefinitionError(ValueError):
    """A message type is undefined, or its definition cannot be read."""


@dataclass(frozen=True)
class Definition:
    """The definition of a message type in a bag."""

    type: str
    """Full name, such as `nav_msgs/msg/Odometry`."""
    encoding: str = ""
    """`ros2msg`, `ros2idl`, or empty if the bag does not define the type."""
    text: str = ""

    @property
    def given(self) -> bool:
        """True if the bag defines the type."""
        return self.encoding in {"ros2msg", "ros2idl", "omgidl"} and bool(self.text)


@lru_cache(maxsize=512)
def types_of(definition: Definition, folder: Path | None, distribution: str) -> Typesdict:
    """Fields of a message type and of all types it uses, by type.

    Args:
        definition: the definition in the bag.
        folder: searched for `<package>/action/<Name>.action` and `<package>/msg/<Name>.msg` if the
            bag does not define the type.
        distribution: ROS distribution such as `jazzy`, whose types complete the definition.

    Raises:
        DefinitionError: the type, or one that it uses, is undefined.
    """
    try:
        known = _own_types(definition, folder)
        if _missing(definition.type, known):
            known = {**_distribution_types(distribution), **known}
        missing = _missing(definition.type, known)
        if missing:
            raise DefinitionError(_what_is_missing(missing[0]))
        _Size(known).measure(definition.type)
    except DefinitionError:
        raise
    except _FAULTS as error:
        raise _definition_error(definition, error) from error
    return known


def _definition_error(definition: Definition, error: Exception) -> DefinitionError:
    cause = " ".join(str(error).encode(errors="replace").decode().split())[:_LONGEST_CAUSE]
    return DefinitionError(
        f"the definition of {definition.type[:_LONGEST_CAUSE]} is wrong: "
        f"{cause or type(error).__name__}"
    )


class _Size:
    """Measures types, which may be nested in more values than memory holds."""

    def __init__(self, types: Typesdict) -> None:
        self._types = types
        self._known: dict[str, tuple[int, int, int]] = {}

    def measure(self, type_: str, depth: int = 1) -> tuple[int, int, int]:
        """Values outside of arrays, values with those of fixed arrays, and levels of a type.

        Raises:
            ValueError: they are too many.
        """
        if type_ in self._known:
            return self._known[type_]
        fields = elements = levels = 1
        for name, field in self._types[type_][1]:
            count, used = _count(field), _used(field)
            if depth > _MOST_LEVELS and used:
                raise ValueError(f"its types are nested more than {_MOST_LEVELS} levels deep")
            inner = self.measure(used[0], depth + 1) if used else (1, 1, 0)
            fields, elements = fields + inner[0], elements + inner[1] * count
            levels = max(levels, inner[2] + 1)
            if count > _MOST_ITEMS:
                raise ValueError(f"its array {name} has more than {_MOST_ITEMS:,} items")
        if fields > _MOST_FIELDS or elements > _MOST_ELEMENTS or levels > _MOST_LEVELS:
            raise ValueError(
                f"{type_} has {fields:,} fields, {elements:,} values in fixed arrays and {levels} "
                f"levels; at most {_MOST_FIELDS:,}, {_MOST_ELEMENTS:,} and {_MOST_LEVELS} are read"
            )
        self._known[type_] = fields, elements, levels
        return self._known[type_]


def _count(field: FieldDesc) -> int:
    """Items of an array of fixed length; 1 for others."""
    kind, what = cast("tuple[Nodetype, Any]", field)
    return int(what[1]) if kind is Nodetype.ARRAY else 1


def _what_is_missing(type_: str) -> str:
    return (
        f"neither the bag nor ROS 2 defines {type_}; add its file `{_file_of(type_)}` to the run "
        "files"
    )


def _missing(type_: str, types: Typesdict) -> list[str]:
    """Undefined types among a type and those it uses."""
    missing: list[str] = []
    wanted, seen = [type_], {type_}
    while wanted:
        name = wanted.pop()
        if name not in types:
            missing.append(name)
            continue
        used = {part for _, field in types[name][1] for part in _used(field)}
        wanted += used - seen
        seen |= used
    return missing


def _used(field: FieldDesc) -> list[str]:
    kind, what = cast("tuple[Nodetype, Any]", field)
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        kind, what = what[0]
    return [what] if kind is Nodetype.NAME and not is_wstring(what) else []


def is_wstring(type_: str) -> bool:
    """True for ROS's 16-bit text, which the parser of definitions takes for a message type."""
    return type_.rpartition("/")[2] == WSTRING


def typestore_of(definition: Definition, folder: Path | None, distribution: str) -> Typestore:
    """A store that deserializes messages of a type; see `types_of`."""
    return _typestore(definition, folder, distribution)


@lru_cache(maxsize=64)
def _typestore(definition: Definition, folder: Path | None, distribution: str) -> Typestore:
    store = get_typestore(Stores.EMPTY)
    types = types_of(definition, folder, distribution)
    try:
        store.register(types)
    except _FAULTS as error:  # such as its own copy of a type of ROS, which differs from ROS's
        raise _definition_error(definition, error) from error
    return store


@lru_cache(maxsize=4)
def _distribution_types(distribution: str) -> Typesdict:
    try:
        return get_typestore(Stores(f"ros2_{distribution}")).fielddefs
    except ValueError:
        return get_typestore(Stores.LATEST).fielddefs


def _own_types(definition: Definition, folder: Path | None) -> Typesdict:
    if not _TYPE.fullmatch(definition.type):
        raise ValueError("it is not the name of a type")
    if len(definition.text) > _LONGEST:
        raise ValueError(f"it has more than {_LONGEST:,} characters")
    if not definition.given:
        return _types_from_files(definition.type, folder)
    text = "\n".join(definition.text.lstrip("\ufeff").splitlines()) + "\n"
    if definition.encoding != "ros2msg":
        return _types_from_idl(text)
    return _types_from_msg(text, definition.type)


def _types_from_msg(text: str, type_: str) -> Typesdict:
    """Types in concatenated .msg files, or in a .srv file followed by .msg files."""
    text = _WSTRING_CONSTANT.sub("", _WSTRING_BOUND.sub(r"\1", text))
    first, *further = _SECTION.split(text)
    parts = _PARTS.split(first)
    if type_.endswith(_EVENT) and len(parts) == 2:
        service = type_.removesuffix(_EVENT)
        package, name = service.split("/")[0], service.rpartition("/")[2]
        names = (f"{package}/{name}_Request", f"{package}/{name}_Response")
        further += (f"MSG: {name}\n{part}" for name, part in zip(names, parts, strict=True))
        first = (
            f"service_msgs/ServiceEventInfo info\n{names[0]}[<=1] request\n"
            f"{names[1]}[<=1] response\n"
        )
    # The parser adds the folder `msg` to types of services.
    plain = type_.replace("/srv/", "/msg/")
    types = get_types_from_msg(f"\n{_SEPARATOR}\n".join([first, *further]), plain)
    types[type_] = types[plain]
    return types


def _types_from_idl(text: str) -> Typesdict:
    """Types in concatenated IDL files, each optionally preceded by a line with its name."""
    if _COMPUTES.search(_ANNOTATION.sub("", _QUOTED.sub("", text))):
        raise ValueError("it has an expression; write the number that it results in")
    types: Typesdict = {}
    for part in _IDL_SEPARATOR.split(text):
        if part.strip():
            types.update(get_types_from_idl(part))
    return types


def _types_from_files(type_: str, folder: Path | None) -> Typesdict:
    path = _find(type_, folder)
    text = read_file(path).decode("utf-8-sig", "replace") if path else ""
    if not type_.endswith(_FEEDBACK):
        return _types_from_msg(text, type_) if path else {}
    action = type_.removesuffix(_FEEDBACK)
    feedback = _PARTS.split(text)[-1] if path else FEEDBACK.get(action)
    if feedback is None:
        return {}
    package, name = action.split("/")[::2]
    message = (
        f"unique_identifier_msgs/UUID goal_id\n{package}/{name}_Feedback feedback\n{_SEPARATOR}\n"
        f"MSG: {package}/{name}_Feedback\n{feedback}\n"
    )
    return get_types_from_msg(message, type_)


def _file_of(type_: str) -> str:
    for ending, suffix in ((_FEEDBACK, ".action"), (_EVENT, ".srv")):
        if type_.endswith(ending) and "/msg/" not in type_:
            return type_.removesuffix(ending) + suffix
    return f"{type_}.msg"


def _find(type_: str, folder: Path | None) -> Path | None:
    found = sorted(folder.rglob(_file_of(type_))) if folder else []
    return found[0] if found else None
