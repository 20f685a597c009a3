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
        own = _own_types(definition, folder)
    except (TypesysError, ValueError, KeyError, IndexError, OSError) as error:
        cause = " ".join(str(error).encode(errors="replace").decode().split())[:_LONGEST_CAUSE]
        raise DefinitionError(f"the definition of {definition.type} is wrong: {cause}") from error
    if not _missing(definition.type, own):
        return own
    known = {**_distribution_types(distribution), **own}
    missing = _missing(definition.type, known)
    if missing:
        raise DefinitionError(_what_is_missing(missing[0]))
    return known


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
    try:
        store.register(types_of(definition, folder, distribution))
    except TypesysError as error:  # its own copy of a type of ROS differs from ROS's
        raise DefinitionError(f"the definition of {definition.type} is wrong: {error}") from error
    return store


@lru_cache(maxsize=4)
def _distribution_types(distribution: str) -> Typesdict:
    try:
        return get_typestore(Stores(f"ros2_{distribution}")).fielddefs
    except ValueError:
        return get_typestore(Stores.LATEST).fielddefs


def _own_types(definition: Definition, folder: Path | None) -> Typesdict:
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
