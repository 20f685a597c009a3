"""A drive in a bag, written without ROS: a robot goes round a circle, and sees a wall around it."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from support.campaigns.bags import TREE, TREE_TYPE, Bag, typestore

RADIUS = 2.0
"""Of the circle [m]"""
ODOMETRY, SCAN, PLAN = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Path"
PICTURE = "sensor_msgs/msg/CompressedImage"
LOG, STRING, GRID = "rcl_interfaces/msg/Log", "std_msgs/msg/String", "nav_msgs/msg/OccupancyGrid"


class DriveBag(Bag):
    """A bag of a drive that is being written; times are seconds since its start."""

    def __init__(
        self,
        folder: Path,
        storage: StoragePlugin = StoragePlugin.MCAP,
        compression: CompressionMode | None = None,
    ) -> None:
        store = typestore(py_trees_ros_interfaces__msg__BehaviourTree=TREE)
        super().__init__(folder, store, storage, compression)

    def pose(self, x: float, y: float, yaw: float) -> Any:
        """A geometry_msgs/msg/Pose."""
        point = self.make("geometry_msgs/msg/Point", x, y, 0.0)
        turn = self.make(
            "geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
        )
        return self.make("geometry_msgs/msg/Pose", point, turn)

    def odometry(
        self, at: float, x: float, y: float, yaw: float, stamp: float | None = None
    ) -> None:
        """Record where the robot is in the frame `odom`."""
        zero = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self.make("geometry_msgs/msg/Twist", zero, zero)
        message = self.make(
            ODOMETRY,
            self.header(at if stamp is None else stamp, "odom"),
            "base_link",
            self.make("geometry_msgs/msg/PoseWithCovariance", self.pose(x, y, yaw), np.zeros(36)),
            self.make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        )
        self.write("/odom", message, at)

    def scan(self, at: float, ranges: list[float], frame: str = "laser") -> None:
        """Record what a laser sees all around."""
        step = 2 * math.pi / len(ranges)
        data = np.array(ranges, dtype=np.float32)
        bounds = (0.0, 2 * math.pi, step, 0.0, 0.1, 0.1, 10.0)
        message = self.make(SCAN, self.header(at, frame), *bounds, data, np.zeros(0, np.float32))
        self.write("/scan", message, at)

    def plan(self, at: float, points: list[tuple[float, float]]) -> None:
        """Record a planned path."""
        header = self.header(at, "map")
        stamped = "geometry_msgs/msg/PoseStamped"
        poses = [self.make(stamped, header, self.pose(x, y, 0.0)) for x, y in points]
        self.write("/plan", self.make(PLAN, header, poses), at)

    def picture(self, at: float, data: bytes, topic: str = "/camera/image/compressed") -> None:
        """Record a picture of the camera."""
        pixels = np.frombuffer(data, np.uint8)
        self.write(topic, self.make(PICTURE, self.header(at, "camera"), "jpeg", pixels), at)

    def say(self, at: float, level: int, text: str) -> None:
        """Record a log message."""
        stamp = self.header(at, "").stamp
        self.write("/rosout", self.make(LOG, stamp, level, "planner", text, "a.py", "f", 1), at)

    def behave(self, at: float, **statuses: int) -> None:
        """Record a behaviour tree: status by behaviour."""
        behaviours = [
            self.make(
                "py_trees_ros_interfaces/msg/Behaviour",
                name,
                "Action",
                self.make("unique_identifier_msgs/msg/UUID", np.full(16, number, np.uint8)),
                0,
                status,
                "",
            )
            for number, (name, status) in enumerate(statuses.items())
        ]
        self.write("/tree", self.make(TREE_TYPE, behaviours), at)

    def map(self, rows: list[list[int]], resolution: float = 0.5) -> None:
        """Record a map whose lower left corner is at 0, 0."""
        cells = np.array(rows, dtype=np.int8)
        stamp = self.header(0.0, "").stamp
        info = self.make(
            "nav_msgs/msg/MapMetaData", stamp, resolution, *cells.T.shape, self.pose(0.0, 0.0, 0.0)
        )
        self.write("/map", self.make(GRID, self.header(0.0, "map"), info, cells.ravel()), 0.0)


def around(at: float) -> tuple[float, float, float]:
    """Pose of the robot on its circle: once around in 20 s."""
    angle = 2 * math.pi * at / 20
    return RADIUS * math.cos(angle), RADIUS * math.sin(angle), angle + math.pi / 2


def photo(red: int, format_: str = "JPEG") -> bytes:
    """A small picture of one colour."""
    file = io.BytesIO()
    Image.new("RGB", (32, 24), (red, 0, 0)).save(file, format_)
    return file.getvalue()


def record_drive(
    folder: Path, seconds: float = 20.0, pictures: bool = False, **options: Any
) -> Path:
    """Write the bag of a drive, its frame `odom` a metre beside `map`; returns its folder.

    Args:
        folder: of the bag.
        seconds: of the drive.
        pictures: whether it has a camera, whose pictures become redder and redder.
        options: of the bag.
    """
    with DriveBag(folder, **options) as bag:
        bag.transforms([bag.transform("base_link", "laser", 0.0, (0.1, 0.0, 0.2))], static=True)
        bag.behave(0.0, Drive=2)
        bag.plan(0.5, [around(at / 2)[:2] for at in range(41)])
        for i in range(round(seconds * 10)):
            at = i / 10
            bag.transforms([bag.transform("map", "odom", at, (1.0, 0.0, 0.0))])
            bag.odometry(at, *around(at))
            bag.scan(at, [2.5] * 90)
            if pictures and i % 2 == 0:
                bag.picture(at, photo(i % 256))
        bag.say(seconds / 2, 30, "the way is long")
        bag.say(seconds - 0.5, 40, "collision with the wall")
        bag.behave(seconds - 0.3, Drive=4)
    return folder
