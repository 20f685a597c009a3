"""Which objects of a bucket are a run's files, and where each of its writers puts them.

```
<variant>/<run>/run.json               the record; it names the list of files
<variant>/<run>/.writer-<id>.json      such a list: path, key, size and SHA-256 of each file
<variant>/<run>/.writer-<id>/<path>    files of one writer, one attempt of one pod
<variant>/<run>/.writer-<id>.long/<n>  those whose path makes no key
```

What no record refers to belongs to nothing: a writer that was killed has left it. In buckets of
older versions records name no list; a run's files are then the objects beside its record.
"""

from __future__ import annotations

import io
import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from threading import Lock
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from robovast.campaign.layout import RUN_RECORD
from robovast.campaign.places import is_plain

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LONGEST_KEY = 1000
"""Of an object; S3 allows 1024 [byte]."""
LONGEST_NAME = 255
"""Of a part of a key, where a server keeps it as a file [byte]."""
MOST_TOLD = 50
"""Missing files that a record names."""
MOST_NAMED = 1000
"""Missing files whose names are known while a run is stored."""
ROOM = 32 << 20
"""Of a list of files [byte]: who reads it, and who writes it, has all of it in memory."""
FULL = f"the list of a run's files is full ({ROOM >> 20} MiB, some 100,000 files)"
_ENTRY = 250
"""What an entry takes besides its path and the end of its key [byte]."""

_WRITER = re.compile(r"\.writer-[0-9a-f]{16}(?:\.json$|\.long/|/)")
_FOLDER_MARK = re.compile(r"__(?=XLDIR__)")
"""Begins what MinIO takes for the mark of a folder: such an object can neither be listed as it is
called nor removed with its bucket."""


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A file of a run, and the object that has its content."""

    path: str
    """In the run's folder; the byte XX that is no UTF-8 is `\\udcXX`, as in `os.fsdecode`."""
    key: str
    """Of the object, below the run's."""
    size: int
    """[byte]"""
    sha256: str
    unknown: Mapping[str, Any] = field(default_factory=dict)
    """What a newer version has written besides."""


@dataclass(frozen=True)
class FileList:
    """What a record says of the list of its run's files."""

    key: str
    """Of the list, below the run's."""
    sha256: str
    """Of the list."""
    count: int
    """Number of files."""
    size: int
    """Of all files together [byte]."""
    revision: int = 0
    """Raised when the record is written again, so that whoever has seen the old one notices."""
    unknown: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)
    """What a newer version has written besides."""

    def revised(self) -> FileList:
        """The same, told from the one before."""
        return replace(self, revision=self.revision + 1)


@dataclass(frozen=True)
class MissingFile:
    """What a run wrote and is not stored."""

    path: str
    """In the run's folder; `\\xNN` is a byte that is no UTF-8."""
    reason: str
    count: int = 1
    """Files that it stands for."""

    def data(self) -> dict[str, Any]:
        """As it is written."""
        return {"path": self.path, "reason": self.reason} | (
            {"count": self.count} if self.count != 1 else {}
        )


class Missing:
    """Files that are not stored, however many: some of them by name, all by number."""

    def __init__(self) -> None:
        self._named: list[MissingFile] = []
        self._others = self._beyond = 0
        self._lock = Lock()

    def add(self, path: str, reason: str) -> None:
        """A file cannot be stored."""
        with self._lock:
            if len(self._named) < MOST_NAMED:
                self._named.append(MissingFile(shown(path), reason))
            else:
                self._others += 1

    def add_beyond(self) -> None:
        """There is no room for a file in the list."""
        self._beyond += 1

    def named(self) -> list[MissingFile]:
        """Those that have a name here, sorted by path."""
        return sorted(self._named, key=lambda file: file.path)

    def told(self, most: int = MOST_NAMED) -> tuple[MissingFile, ...]:
        """No more of them than a record should hold, and how many others there are."""
        named = self.named()
        others = self._others + len(named[most:])
        beyond = [MissingFile("…", f"{self._beyond:,} files: {FULL}", self._beyond)]
        rest = [MissingFile("…", f"and {others} more", others)]
        return (*(beyond if self._beyond else []), *named[:most], *(rest if others else []))


def room_of(path: str) -> int:
    """What an entry of a list may take at most, beside others [byte]."""
    return _ENTRY + len(json.dumps(path)) + len(json.dumps(escaped(path)))


class Writer:
    """A place of its own in a run's part of a bucket, which nobody else writes to.

    Args:
        run: `<variant>/<number>`.
    """

    def __init__(self, run: str) -> None:
        self.run = run
        self._place = f".writer-{uuid4().hex[:16]}"

    @property
    def list_key(self) -> str:
        """Key of the list of files, below the run's."""
        return f"{self._place}.json"

    def key(self, path: str, number: int) -> str:
        """Key of a file, below the run's.

        Args:
            path: of the file in the run's folder, as `os.fsdecode` has it.
            number: of the file; no other has it.
        """
        key = f"{self._place}/{escaped(path)}"
        return key if is_key(f"{self.run}/{key}") else f"{self._place}.long/{number}"


def escaped(path: str) -> str:
    """A path as a part of a key: what is no printable text as `\\xNN`, `\\` as `\\\\`."""
    text = os.fsencode(path).decode("utf-8", "surrogateescape")
    return _FOLDER_MARK.sub(r"_\\x5f", "".join(map(_escaped, text)))


def _escaped(character: str) -> str:
    if character == "\\":
        return "\\\\"
    if character.isprintable():
        return character
    return "".join(f"\\x{byte:02x}" for byte in character.encode("utf-8", "surrogateescape"))


def is_key(key: str) -> bool:
    """True when servers take it as the key of an object."""
    return len(key.encode()) <= LONGEST_KEY and all(
        len(part.encode()) <= LONGEST_NAME for part in key.split("/")
    )


def shown(path: str) -> str:
    """A path that people can read, and any program write."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")


def is_writers(key: str) -> bool:
    """True for the key of what a writer stored, below its run's."""
    return _WRITER.match(key) is not None


def write_list(files: Iterable[StoredFile]) -> bytes:
    """The list of a run's files, as it is stored."""
    text = io.BytesIO()
    text.write(b'{"files": [')
    separator = b"\n"
    for file in sorted(files, key=lambda file: file.path):
        text.write(separator + json.dumps(with_unknown(asdict(file))).encode())
        separator = b",\n"
    text.write(b"\n]}")
    return text.getvalue()


def read_list(content: bytes) -> list[StoredFile]:
    """The files in a list.

    Raises:
        ValueError: it is none, or a path or key in it leads elsewhere.
    """
    try:
        items = json.loads(content)["files"]
        files = [StoredFile(**with_unknown_apart(item, StoredFile)) for item in items]
        for file in files:
            _check(file)
    except (KeyError, TypeError, AttributeError, RecursionError, UnicodeError) as error:
        raise ValueError(f"it is no list of files: {error!r}") from error
    if len({file.path for file in files}) < len(files):
        raise ValueError("it has a path twice")
    return files


def with_unknown_apart(data: Mapping[str, Any], kind: type[DataclassInstance]) -> dict[str, Any]:
    """What was read, what the class does not know of it under `unknown`: a newer version's."""
    known = {field.name for field in fields(kind)} - {"unknown"}
    rest = {key: data[key] for key in data if key not in known}
    return {**{key: data[key] for key in data if key in known}, "unknown": rest}


def with_unknown(data: dict[str, Any]) -> dict[str, Any]:
    """As it is written: what was not known stands beside the rest again."""
    return {**data.pop("unknown"), **data}


def _check(file: StoredFile) -> None:
    """Refuse what no writer has written."""
    if type(file.size) is not int or file.size < 0 or not isinstance(file.sha256, str):
        raise ValueError(f"it has no size or no SHA-256 of {file.path!r}")
    os.fsencode(file.path)
    if not is_inside(file.path) or not is_inside(file.key) or not is_key(file.key):
        raise ValueError(f"it has a path that leads out of its folder: {file.path!r}")


def is_inside(path: str) -> bool:
    """True for a path that stays in a run's folder, and is not the record's, nor in it."""
    return is_plain(path) and path.partition("/")[0] != RUN_RECORD
