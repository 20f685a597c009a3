"""Helpers for scripts that convert ROS bags, in a container or here.

This file needs nothing but Python, so that it works beside a script wherever that runs:
its atomic writing is its own.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

_DATE = re.compile(r"_\d{4}_\d\d_\d\d-\d\d_\d\d_\d\d$")
_NO_FIELDS = {"__msgtype__", "structure_needs_at_least_one_member"}
"""What messages of the package rosbags have besides their fields."""


def write_provenance_entry(
    provenance_file_path: str | Path | None,
    output_rel: str | Path,
    sources_rel: Iterable[str | Path],
    plugin_name: str,
    params: dict[str, Any] | None = None,
) -> None:
    """Append what a file was made from to a provenance file.

    The file holds `{"entries": [{"output", "sources", "plugin", "params"}]}`.

    Args:
        provenance_file_path: the file; nothing is done without one.
        output_rel: the file that was made, relative to the results folder.
        sources_rel: what it was made from, likewise.
        plugin_name: the plugin that made it.
        params: the plugin's parameters.

    Raises:
        ValueError: the file exists, and is no provenance file.
    """
    if not provenance_file_path:
        return
    path = Path(provenance_file_path)
    entries = _entries(path) if os.path.exists(path) and path.stat().st_size else []
    sources = [sources_rel] if isinstance(sources_rel, (str, Path)) else sources_rel
    entries.append(
        {
            "output": str(output_rel),
            "sources": [str(source) for source in sources],
            "plugin": plugin_name,
            "params": params or {},
        }
    )
    part = path.with_name(f".{path.name}.part")
    part.write_text(json.dumps({"entries": entries}, indent=1) + "\n", encoding="utf-8")
    os.replace(part, path)


def _entries(path: Path) -> list[Any]:
    try:
        return list(json.loads(path.read_text(encoding="utf-8"))["entries"])
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path} is not a provenance file: it has no list `entries`") from error


def find_rosbags(directory: str | Path, bag_dir_name: str = "rosbag2") -> list[str]:
    """Paths of all bags at or below a folder, sorted.

    Args:
        directory: where to search; links are not followed.
        bag_dir_name: name of a bag's folder, or a pattern such as `rosbag2_*`. A folder whose name
            has the recorder's date in addition (`rosbag2_2026_01_31-12_00_00`) is found, too.
    """
    top = Path(directory)
    found = [str(top)] if _is_named(top.name, bag_dir_name) and os.path.isdir(top) else []
    for folder, names, _ in os.walk(directory):
        bags = {name for name in names if _is_named(name, bag_dir_name)}
        found += (os.path.join(folder, name) for name in bags)
        names[:] = [name for name in names if name not in bags]  # a bag has no bags in it
    return sorted(path for path in found if not os.path.islink(path))


def _is_named(name: str, wanted: str) -> bool:
    return fnmatchcase(name, wanted) or fnmatchcase(_DATE.sub("", name), wanted)


def gen_msg_values(msg: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Names and values of all fields of a message, nested ones as `a.b` and `a[0].b`.

    Args:
        msg: a message of rclpy or of the package rosbags, or a value in one.
        prefix: the name of the value itself.
    """
    fields = _field_names(msg)
    if fields is not None:
        for name in fields:
            yield from gen_msg_values(getattr(msg, name), f"{prefix}.{name}" if prefix else name)
    elif _is_sequence(msg):
        for index, item in enumerate(msg):
            yield from gen_msg_values(item, f"{prefix}[{index}]")
    else:
        yield prefix, msg


def _field_names(msg: Any) -> list[str] | None:
    """Names of a message's fields; None when it is no message."""
    if hasattr(msg, "get_fields_and_field_types"):
        return list(msg.get_fields_and_field_types())
    fields = getattr(msg, "__dataclass_fields__", None)
    return [name for name in fields if name not in _NO_FIELDS] if fields else None


def _is_sequence(value: Any) -> bool:
    """True for lists and for arrays of the standard library and of NumPy."""
    if isinstance(value, list | tuple):
        return True
    return hasattr(value, "tolist") and hasattr(value, "__len__")
