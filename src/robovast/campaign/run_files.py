"""Keys of a run's files in a bucket, and where each writer stores them.

```
<variant>/<run>/run.json               the record; it names the list of files
<variant>/<run>/.writer-<id>.json      the list: path, key, size and SHA-256 of each file
<variant>/<run>/.writer-<id>/<path>    files of one writer, i.e. of one attempt in one pod
<variant>/<run>/.writer-<id>.long/<n>  files whose paths cannot be keys
```

Objects without a reference in a record were left by a writer that was killed, and are ignored.
Records of other tools name no list; a run's files are then the objects beside its record.
"""

from __future__ import annotations

import io
import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from threading import Lock
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from robovast.campaign.layout import RUN_RECORD
from robovast.campaign.object_keys import is_plain

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LONGEST_KEY = 1000
"""Longest key that is used [byte]; S3 allows 1024."""
LONGEST_NAME = 255
"""Longest part of a key [byte]; some servers store it as a file name."""
MOST_LISTED = 50
"""Most missing files that a record names."""
MOST_NAMED = 1000
"""Most missing files whose names are remembered while a run is stored."""
ROOM = 32 << 20
"""Largest list of files [byte]; readers and writers hold it in memory."""
FULL = f"the list of a run's files is full ({ROOM >> 20} MiB, some 100,000 files)"
_ENTRY = 250
"""Size of an entry without its path and key suffix [byte]."""

_WRITER = re.compile(r"\.writer-[0-9a-f]{16}(?:\.json$|\.long/|/)")
_FOLDER_MARK = re.compile(r"__(?=XLDIR__)")
"""Suffix that MinIO uses for folder markers: such objects can neither be listed under their name
nor removed with their bucket."""


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A file of a run, and the object that stores its content."""

    path: str
    """Path in the run's folder; a byte XX of invalid UTF-8 is `\\udcXX`, as in `os.fsdecode`."""
    key: str
    """Key of the object, relative to the run's."""
    size: int
    """[byte]"""
    sha256: str
    unknown: Mapping[str, Any] = field(default_factory=dict)
    """Keys that a newer version wrote."""


@dataclass(frozen=True)
class FileList:
    """The reference to a run's list of files in its record."""

    key: str
    """Key of the list, relative to the run's."""
    sha256: str
    """SHA-256 of the list."""
    count: int
    """Number of files."""
    size: int
    """Total size of all files [byte]."""
    revision: int = 0
    """Number that is raised with every rewrite, so that readers of the old record notice it."""
    unknown: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)
    """Keys that a newer version wrote."""

    def revised(self) -> FileList:
        """The same reference with the next revision."""
        return replace(self, revision=self.revision + 1)


@dataclass(frozen=True)
class MissingFile:
    """A file that the run wrote and that could not be stored."""

    path: str
    """Path in the run's folder; `\\xNN` is a byte of invalid UTF-8."""
    reason: str
    count: int = 1
    """Number of files that this item represents."""

    def data(self) -> dict[str, Any]:
        """The item as JSON data."""
        return {"path": self.path, "reason": self.reason} | (
            {"count": self.count} if self.count != 1 else {}
        )


class Missing:
    """Files that could not be stored: counted, and some of them named."""

    def __init__(self) -> None:
        self._named: list[MissingFile] = []
        self._others = self._beyond = 0
        self._lock = Lock()

    def add(self, path: str, reason: str) -> None:
        """Add a file that cannot be stored."""
        with self._lock:
            if len(self._named) < MOST_NAMED:
                self._named.append(MissingFile(shown(path), reason))
            else:
                self._others += 1

    def add_beyond(self) -> None:
        """Count a file for which the list has no room."""
        self._beyond += 1

    def named(self) -> list[MissingFile]:
        """Files whose names are known, sorted by path."""
        return sorted(self._named, key=lambda file: file.path)

    def first(self, most: int = MOST_NAMED) -> tuple[MissingFile, ...]:
        """At most `most` files by name, then an item that counts the others."""
        named = self.named()
        others = self._others + len(named[most:])
        beyond = [MissingFile("…", f"{self._beyond:,} files: {FULL}", self._beyond)]
        rest = [MissingFile("…", f"and {others} more", others)]
        return (*(beyond if self._beyond else []), *named[:most], *(rest if others else []))


def room_of(path: str) -> int:
    """Largest size of a path's entry in a list [byte]."""
    return _ENTRY + len(json.dumps(path)) + len(json.dumps(escaped(path)))


class Writer:
    """A place in a run's part of the bucket to which only one writer writes.

    Args:
        run: `<variant>/<number>`.
    """

    def __init__(self, run: str) -> None:
        self.run = run
        self._place = f".writer-{uuid4().hex[:16]}"

    @property
    def list_key(self) -> str:
        """Key of the list of files, relative to the run's."""
        return f"{self._place}.json"

    def key(self, path: str, number: int) -> str:
        """Key of a file, relative to the run's.

        Args:
            path: path in the run's folder, as `os.fsdecode` returns it.
            number: unique number of the file.
        """
        key = f"{self._place}/{escaped(path)}"
        return key if is_key(f"{self.run}/{key}") else f"{self._place}.long/{number}"


def escaped(path: str) -> str:
    """A path as part of a key: non-printable characters become `\\xNN`, `\\` becomes `\\\\`."""
    text = os.fsencode(path).decode("utf-8", "surrogateescape")
    return _FOLDER_MARK.sub(r"_\\x5f", "".join(map(_escaped, text)))


def _escaped(character: str) -> str:
    if character == "\\":
        return "\\\\"
    if character.isprintable():
        return character
    return "".join(f"\\x{byte:02x}" for byte in character.encode("utf-8", "surrogateescape"))


def is_key(key: str) -> bool:
    """Whether servers accept the key."""
    return len(key.encode()) <= LONGEST_KEY and all(
        len(part.encode()) <= LONGEST_NAME for part in key.split("/")
    )


def shown(path: str) -> str:
    """A path in printable characters."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")


def is_writers(key: str) -> bool:
    """Whether a key, relative to the run's, belongs to a writer."""
    return _WRITER.match(key) is not None


def write_list(files: Iterable[StoredFile]) -> bytes:
    """Serialize a run's list of files."""
    text = io.BytesIO()
    text.write(b'{"files": [')
    separator = b"\n"
    for file in sorted(files, key=lambda file: file.path):
        text.write(separator + json.dumps(with_unknown(asdict(file))).encode())
        separator = b",\n"
    text.write(b"\n]}")
    return text.getvalue()


def read_list(content: bytes) -> list[StoredFile]:
    """Parse a run's list of files.

    Raises:
        ValueError: the content is not a list of files, or a path or key leaves the run.
    """
    try:
        items = json.loads(content)["files"]
        files = [StoredFile(**with_unknown_apart(item, StoredFile)) for item in items]
        for file in files:
            _check(file)
    except (KeyError, TypeError, AttributeError, RecursionError, UnicodeError) as error:
        raise ValueError(f"it is not a list of files: {error!r}") from error
    if len({file.path for file in files}) < len(files):
        raise ValueError("a path occurs twice")
    return files


def with_unknown_apart(data: Mapping[str, Any], kind: type[DataclassInstance]) -> dict[str, Any]:
    """Move keys that the class does not know (of newer versions) to `unknown`."""
    unknown = data.keys() - _known_keys(kind)
    if not unknown:
        return {**data, "unknown": {}}
    rest = {key: data[key] for key in data if key in unknown}
    return {**{key: data[key] for key in data if key not in unknown}, "unknown": rest}


@cache
def _known_keys(kind: type[DataclassInstance]) -> frozenset[str]:
    """Names of a class's fields, looked up once: a campaign has 100,000 records."""
    return frozenset(field.name for field in fields(kind)) - {"unknown"}


def with_unknown(data: dict[str, Any]) -> dict[str, Any]:
    """Undo `with_unknown_apart` before data is written."""
    return {**data.pop("unknown"), **data}


def _check(file: StoredFile) -> None:
    """Refuse entries that no writer makes."""
    if type(file.size) is not int or file.size < 0 or not isinstance(file.sha256, str):
        raise ValueError(f"it lacks a valid size or SHA-256 of {file.path!r}")
    os.fsencode(file.path)
    if not is_inside(file.path) or not is_inside(file.key) or not is_key(file.key):
        raise ValueError(f"a path leaves its folder: {file.path!r}")


def is_inside(path: str) -> bool:
    """Whether a path stays in a run's folder and is neither the record nor in it."""
    return is_plain(path) and path.partition("/")[0] != RUN_RECORD
