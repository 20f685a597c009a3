"""Reads all messages of a bag from its files in order of time, compressed or not."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from robovast.analysis.bags import zstd
from robovast.analysis.bags.mcap_file import McapFile
from robovast.analysis.bags.order import in_order
from robovast.analysis.bags.source import BagFile, Consumer, Subscribe, Types, Warn
from robovast.analysis.bags.sqlite_file import SqliteFile
from robovast.base.bounds import patient
from robovast.base.safe_paths import is_file, open_file, read_file
from robovast.base.yaml_files import parse_yaml

PLAIN = (".mcap", ".db3")
COMPRESSED = tuple(f"{kind}{ending}" for kind in PLAIN for ending in (".zstd", ".zst"))


class _Topic(BaseModel):
    name: str
    type: str = ""


class _Counted(BaseModel):
    topic_metadata: _Topic


class BagInfo(BaseModel):
    """Content of a bag's `metadata.yaml`; recorders that were killed leave none."""

    model_config = ConfigDict(frozen=True)

    files: tuple[str, ...] = Field(default=(), alias="relative_file_paths")
    distribution: str = Field(default="", alias="ros_distro")
    """ROS distribution, such as `jazzy`."""
    counted: tuple[_Counted, ...] = Field(default=(), alias="topics_with_message_count")

    @property
    def topics(self) -> dict[str, str]:
        """Type of each topic."""
        return {topic.topic_metadata.name: topic.topic_metadata.type for topic in self.counted}


class _Metadata(BaseModel):
    rosbag2_bagfile_information: BagInfo


def read_info(folder: Path, warn: Warn) -> BagInfo:
    """Read the metadata of a bag, if there are any."""
    try:
        data = parse_yaml(read_file(folder / "metadata.yaml").decode("utf-8", "replace"))
        return _Metadata.model_validate(_without_nulls(data)).rosbag2_bagfile_information
    except FileNotFoundError:
        warn(f"{folder.name} has no metadata.yaml: its recorder was stopped while writing")
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        warn(f"{folder.name}/metadata.yaml cannot be read: {place}: {first['msg']}")
    except (OSError, ValueError, RecursionError) as error:
        cause = " ".join(str(error).split())
        warn(f"{folder.name}/metadata.yaml cannot be read: {cause}")
    return BagInfo()


def _without_nulls(data: object) -> object:
    """Metadata without keys that have no value."""
    if not isinstance(data, dict):
        return data
    return {key: _without_nulls(value) for key, value in data.items() if value is not None}


def read_bag(folder: Path, info: BagInfo, subscribe: Subscribe, warn: Warn) -> None:
    """Pass every message of a bag to its topic's consumer, in order of time.

    Args:
        folder: the bag.
        info: result of `read_info`.
        subscribe: called at least once for every topic of the files.
        warn: receives warnings about missing and unreadable data.
    """
    paths = _files(folder)
    found = {_plain_name(path.name) for path in paths}
    for missing in {_plain_name(Path(name).name) for name in info.files} - found:
        warn(f"{folder.name}/{missing} is missing")
    if not paths:
        warn(f"{folder.name} has no .mcap or .db3 file")
    read_files(paths, info.topics, subscribe, warn)


def _files(folder: Path) -> list[Path]:
    """Files with messages, in recording order."""
    names = (name for name in os.listdir(folder) if name.endswith((*PLAIN, *COMPRESSED)))
    plain: dict[str, Path] = {}
    for name in sorted(names):  # plain files come before their compressed copies
        if is_file(folder / name, folder):
            plain.setdefault(_plain_name(name), folder / name)
    return sorted(plain.values(), key=lambda path: _natural(path.name))


def _plain_name(name: str) -> str:
    return name.removesuffix(".zstd").removesuffix(".zst")


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(part or 0), text) for text, part in re.findall(r"(\D*)(\d*)", name)]


def read_files(paths: Sequence[Path], types: Types, subscribe: Subscribe, warn: Warn) -> None:
    """Pass every message of some files of a bag to its topic's consumer; see `read_bag`."""
    with ExitStack() as stack:
        files = []
        for path in paths:
            if path.name.endswith(COMPRESSED):
                folder = Path(stack.enter_context(TemporaryDirectory()))
                path = _decompressed(path, folder, warn)
            files.append(_opened(path, types))
        consumers: list[dict[int, Consumer]] = []
        for file in files:
            found = {number: subscribe(topic) for number, topic in file.topics.items()}
            consumers.append({number: consumer for number, consumer in found.items() if consumer})
        for time, number, channel, data in in_order(files, consumers):
            consumers[number][channel](time, data)
        for fault in dict.fromkeys(fault for file in files for fault in file.faults):
            warn(fault)


def _opened(path: Path, types: Types) -> BagFile:
    if path.name.endswith(".mcap"):
        return McapFile(partial(open_file, path), path.name, types, patient())
    return SqliteFile(path, types, patient())


def _decompressed(path: Path, folder: Path, warn: Warn) -> Path:
    plain = folder / _plain_name(path.name)
    with open_file(path) as source:
        try:
            zstd.decompress_file(source, plain)
        except ValueError as error:
            warn(f"{path.name} {error}")
    return plain
