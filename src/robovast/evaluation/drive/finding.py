"""Which bag of a run is played, and which topics its document names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from robovast.base.errors import RobovastError
from robovast.evaluation.files import FileEntry
from robovast.evaluation.notebooks.workloads import Target, read_document
from robovast.evaluation.untrusted import mapping

_USUAL = "rosbag2"
_KINDS = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")


@dataclass(frozen=True)
class Named:
    """The table `evaluation.player` of a document."""

    topics: Mapping[str, str] = field(default_factory=dict)
    """Topics by role"""
    bag: str = ""
    fault: str = ""
    """Why the document cannot be read."""


def read_named(target: Target) -> Named:
    """What a campaign's document names."""
    try:
        _, document = read_document(target, None)
    except RobovastError as error:
        return Named(fault=f"The topics are guessed: {error}")
    table = mapping(mapping(document.get("evaluation")).get("player"))
    topics = {key: value for key, value in table.items() if isinstance(value, str)}
    return Named(topics, topics.pop("bag", ""))


def bags_in(files: Iterable[FileEntry]) -> list[str]:
    """Folders with files of bags, even of recorders that were killed; the likeliest first."""
    folders = {str(PurePosixPath(e.path).parent) for e in files if e.path.endswith(_KINDS)}
    return sorted(folders, key=lambda path: (not path.endswith(_USUAL), path.count("/"), path))


def chosen(bags: Sequence[str], name: str) -> str | None:
    """The bag whose path ends with a name, or the likeliest one."""
    end = PurePosixPath(name).parts
    fitting = (bag for bag in bags if PurePosixPath(bag).parts[-len(end) :] == end)
    return next(iter(bags if not name else fitting), None)
