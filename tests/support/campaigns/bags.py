"""Bags for tests, written without ROS."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from robovast.analysis.bags.convert import Conversion, convert_run
from robovast.model.document.commands import BagCommand

START = 1_700_000_000_000_000_000
"""[ns]"""
SECOND = 1_000_000_000

TREE = """\
Behaviour[] behaviours
================================================================================
MSG: py_trees_ros_interfaces/Behaviour
string name
string class_name
unique_identifier_msgs/UUID own_id
uint8 type
uint8 status
string message
================================================================================
MSG: unique_identifier_msgs/UUID
uint8[16] uuid
"""
FEEDBACK = """\
unique_identifier_msgs/UUID goal_id
nav2_msgs/NavigateToPose_Feedback feedback
================================================================================
MSG: nav2_msgs/NavigateToPose_Feedback
geometry_msgs/PoseStamped current_pose
builtin_interfaces/Duration navigation_time
builtin_interfaces/Duration estimated_time_remaining
int16 number_of_recoveries
float32 distance_remaining
"""
TREE_TYPE = "py_trees_ros_interfaces/msg/BehaviourTree"
FEEDBACK_TYPE = "nav2_msgs/action/NavigateToPose_FeedbackMessage"


@lru_cache
def typestore(**custom: str) -> Typestore:
    """The types of ROS Jazzy, and custom ones: definition by name, `__` for `/`."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in custom.items():
        types = get_types_from_msg(text, name.replace("__", "/"))
        store.register({key: value for key, value in types.items() if key not in store.types})
    return store


class Bag:
    """A bag that is being written."""

    def __init__(
        self,
        folder: Path,
        store: Typestore | None = None,
        storage: StoragePlugin = StoragePlugin.MCAP,
        compression: CompressionMode | None = None,
    ) -> None:
        self.folder = folder
        self.store = store or typestore()
        folder.parent.mkdir(parents=True, exist_ok=True)
        self._writer = Writer(folder, version=9, storage_plugin=storage)
        if compression:
            self._writer.set_compression(compression, CompressionFormat.ZSTD)
        self._connections: dict[tuple[str, str], Any] = {}

    def __enter__(self) -> Bag:
        self._writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def make(self, type_: str, *values: Any) -> Any:
        """A message of a type, its fields in order."""
        return self.store.types[type_](*values)

    def topic(self, topic: str, type_: str) -> Any:
        """A topic, with or without messages."""
        if (topic, type_) not in self._connections:
            connection = self._writer.add_connection(topic, type_, typestore=self.store)
            self._connections[topic, type_] = connection
        return self._connections[topic, type_]

    def write(self, topic: str, message: Any, at: float = 0.0, little_endian: bool = True) -> None:
        """Record a message, so many seconds after the start."""
        type_ = message.__msgtype__
        data = self.store.serialize_cdr(message, type_, little_endian=little_endian)
        self.write_raw(topic, type_, bytes(data), at)

    def write_raw(self, topic: str, type_: str, data: bytes, at: float = 0.0) -> None:
        """Record bytes as a message."""
        self._writer.write(self.topic(topic, type_), START + round(at * SECOND), data)

    def header(self, at: float, frame: str) -> Any:
        """A std_msgs/msg/Header."""
        time = START + round(at * SECOND)
        stamp = self.make("builtin_interfaces/msg/Time", *divmod(time, SECOND))
        return self.make("std_msgs/msg/Header", stamp, frame)

    def transform(
        self,
        parent: str,
        child: str,
        at: float,
        position: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
    ) -> Any:
        """A geometry_msgs/msg/TransformStamped."""
        vector = self.make("geometry_msgs/msg/Vector3", *position)
        half = yaw / 2
        turn = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, np.sin(half), np.cos(half))
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            self.header(at, parent),
            child,
            self.make("geometry_msgs/msg/Transform", vector, turn),
        )

    def transforms(self, transforms: Iterable[Any], static: bool = False) -> None:
        """Record transforms, each as a message at its own time."""
        for transform in transforms:
            message = self.make("tf2_msgs/msg/TFMessage", [transform])
            stamp = transform.header.stamp
            at = (stamp.sec * SECOND + stamp.nanosec - START) / SECOND
            self.write("/tf_static" if static else "/tf", message, max(at, 0.0))


def rows(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file by column."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def convert_alone(bag: Path, job: BagCommand, definitions: Path | None = None) -> Conversion:
    """Do one job with one bag."""
    job = job.model_copy(update={"bag_dir": bag.name})
    return convert_run(bag.parent, [job], definitions)
