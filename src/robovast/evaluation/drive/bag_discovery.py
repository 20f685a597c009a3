"""Which bag of a run is played, and which topics its document names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from robovast.analysis.bags.names import ends_with, undated
from robovast.base.errors import RobovastError
from robovast.evaluation.confined_files import MissingError
from robovast.evaluation.files import FileEntry, list_files
from robovast.evaluation.notebooks.workloads import Target, read_document
from robovast.evaluation.untrusted_data import mapping

_USUAL = "rosbag2"
_KINDS = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")


@dataclass(frozen=True)
class PlayerTopics:
    """The table `evaluation.player` of a document."""

    topics: Mapping[str, str] = field(default_factory=dict)
    """Topics by role"""
    bag: str = ""
    fault: str = ""
    """Why the document cannot be read."""


def read_named(target: Target) -> PlayerTopics:
    """What a campaign's document names."""
    try:
        _, document = read_document(target, None)
    except RobovastError as error:
        return PlayerTopics(fault=f"The topics are guessed: {error}")
    table = mapping(mapping(document.get("evaluation")).get("player"))
    topics = {key: value for key, value in table.items() if isinstance(value, str)}
    return PlayerTopics(topics, topics.pop("bag", ""))


def bag_of(results: Path, place: str, named: PlayerTopics) -> str:
    """The bag of a run that is played: the named one, or the likeliest.

    Args:
        results: the results folder.
        place: the run's folder, relative to it.
        named: what the campaign's document names.

    Raises:
        InputError: there is none.
    """
    bags = bags_in(list_files(results, place))
    bag = chosen(bags, named.bag)
    if bag is None and bags:
        known = ", ".join(path.removeprefix(f"{place}/") for path in bags)
        raise MissingError(
            f"No bag's path ends with {named.bag}, which `evaluation.player.bag` names; the run "
            f"has {known}.",
            hint="correct `evaluation.player.bag`",
        )
    if bag is None:
        raise MissingError(
            "The run has no bag: no folder with .mcap or .db3 files",
            hint="record a bag to the output folder in the scenario",
        )
    return bag


def bags_in(files: Iterable[FileEntry]) -> list[str]:
    """Folders with files of bags, even of recorders that were killed; the likeliest first."""
    folders = {str(PurePosixPath(e.path).parent) for e in files if e.path.endswith(_KINDS)}
    return sorted(
        folders, key=lambda path: (not undated(path).endswith(_USUAL), path.count("/"), path)
    )


def chosen(bags: Sequence[str], name: str) -> str | None:
    """The bag whose path ends with a name, or the likeliest one."""
    fitting = (bag for bag in bags if ends_with(PurePosixPath(bag), name))
    return next(iter(bags if not name else fitting), None)
