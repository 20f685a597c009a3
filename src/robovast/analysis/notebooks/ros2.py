"""What a recorded bag holds, for notebooks."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from robovast.base.safe_paths import read_file
from robovast.base.yaml_files import parse_yaml


def get_bag_info(bag_path: str | Path) -> dict[str, Any]:
    """What the metadata of a bag's folder says: duration, topics, message counts.

    Raises:
        ValueError: the folder is no bag.
    """
    path = Path(bag_path) / "metadata.yaml"
    try:
        return dict(parse_yaml(read_file(path))["rosbag2_bagfile_information"])
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ValueError(
            f"{bag_path}: is not a valid bag: {type(error).__name__}: {error}"
        ) from error


def print_bag_topics(bag_path: str | Path, bag_dir_name: str = "rosbag2") -> None:
    """Print topics, types and message counts of a run's bag, from its metadata.

    Args:
        bag_path: folder of the run, or of the bag itself.
        bag_dir_name: the bag's folder in that of the run.

    Raises:
        ValueError: there is no bag.
    """
    folder = Path(bag_path)
    folder = folder / bag_dir_name if os.path.isdir(folder / bag_dir_name) else folder
    for topic in get_bag_info(folder)["topics_with_message_count"]:
        info = topic["topic_metadata"]
        print(f"{info['name']}  {info['type']}  {topic['message_count']}")  # noqa: T201
