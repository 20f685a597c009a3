"""Reads all messages of a bag from its files in order, compressed or not."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import Any

import zstandard

from robovast.analysis.bags.mcap_file import read_mcap
from robovast.analysis.bags.source import Consumer, Subscribe, Topic, Warn
from robovast.analysis.bags.sqlite_file import read_sqlite
from robovast.base.safe_paths import is_file, open_file, read_text
from robovast.base.yaml_files import parse_yaml

_KINDS = (".mcap", ".db3")
_ZSTD = ".zstd"


@dataclass(frozen=True)
class BagInfo:
    """Content of a bag's `metadata.yaml`; recorders that were killed leave none."""

    files: tuple[str, ...] = ()
    distribution: str = ""
    """ROS distribution, such as `jazzy`."""
    compressed_messages: bool = False
    topics: dict[str, str] = field(default_factory=dict)
    """Type of each topic."""


def read_info(folder: Path, warn: Warn) -> BagInfo:
    """Read the metadata of a bag, if there are any."""
    try:
        text = read_text(folder / "metadata.yaml")
        return _info(parse_yaml(text)["rosbag2_bagfile_information"])
    except FileNotFoundError:
        warn(f"{folder.name} has no metadata.yaml: its recorder was stopped while writing")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        warn(f"{folder.name}/metadata.yaml cannot be read: {error!r}")
    return BagInfo()


def _info(data: dict[str, Any]) -> BagInfo:
    topics = (topic["topic_metadata"] for topic in data.get("topics_with_message_count") or [])
    return BagInfo(
        files=tuple(data.get("relative_file_paths") or ()),
        distribution=str(data.get("ros_distro") or ""),
        compressed_messages=str(data.get("compression_mode") or "").upper() == "MESSAGE",
        topics={topic["name"]: topic["type"] for topic in topics},
    )


def read_bag(folder: Path, info: BagInfo, subscribe: Subscribe, warn: Warn) -> None:
    """Pass every message of a bag to its topic's consumer, in recording order.

    Args:
        folder: the bag.
        info: result of `read_info`.
        subscribe: called at least once for every topic of the files.
        warn: receives warnings about missing and unreadable data.
    """
    if info.compressed_messages:
        subscribe = _decompressing(subscribe, warn)
    files = _files(folder)
    for missing in {Path(name).name for name in info.files} - {file.name for file in files}:
        warn(f"{folder.name}/{missing} is missing")
    if not files:
        warn(f"{folder.name} has no .mcap or .db3 file")
    for file in files:
        read_file(file, subscribe, warn)


def _files(folder: Path) -> list[Path]:
    """Files with messages, in recording order."""
    names = (name for name in os.listdir(folder) if name.removesuffix(_ZSTD).endswith(_KINDS))
    plain: dict[str, Path] = {}
    for name in sorted(names):  # plain files come before their compressed copies
        if is_file(folder / name, folder):
            plain.setdefault(name.removesuffix(_ZSTD), folder / name)
    return sorted(plain.values(), key=lambda path: _natural(path.name))


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(part or 0), text) for text, part in re.findall(r"(\D*)(\d*)", name)]


def read_file(path: Path, subscribe: Subscribe, warn: Warn) -> None:
    """Pass every message of one file of a bag to its topic's consumer; see `read_bag`."""
    if path.name.endswith(".mcap"):
        with open_file(path) as file:
            read_mcap(file, path.name, subscribe, warn)
    elif path.name.endswith(".db3"):
        read_sqlite(path, subscribe, warn)
    else:
        _read_compressed(path, subscribe, warn)


def _read_compressed(path: Path, subscribe: Subscribe, warn: Warn) -> None:
    with TemporaryDirectory() as folder:
        plain = Path(folder) / path.name.removesuffix(_ZSTD)
        with open_file(path) as source, plain.open("wb") as target:
            try:
                copyfileobj(zstandard.ZstdDecompressor().stream_reader(source), target)
            except zstandard.ZstdError as error:
                warn(f"{path.name} is damaged: {error}")
        read_file(plain, subscribe, warn)


def _decompressing(subscribe: Subscribe, warn: Warn) -> Subscribe:
    """Subscribe to individually compressed messages."""

    def wrapped(topic: Topic) -> Consumer | None:
        consumer = subscribe(topic)
        return consumer and _decompress_for(consumer, topic.name, warn)

    return wrapped


def _decompress_for(consumer: Consumer, name: str, warn: Warn) -> Consumer:
    def consume(time: int, data: bytes) -> None:
        try:
            plain = zstandard.ZstdDecompressor().decompressobj().decompress(data)
        except zstandard.ZstdError as error:
            warn(f"a message on {name} cannot be decompressed: {error}")
        else:
            consumer(time, plain)

    return consume
