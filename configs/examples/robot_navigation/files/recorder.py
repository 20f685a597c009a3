"""Records topics to a bag (MCAP), in simulated time, and transforms as /tf and /tf_static.

There is no wheel of tf2_msgs, so nodes publish single transforms; the bag has TFMessages.
"""

from __future__ import annotations

import struct
from pathlib import Path as FilePath

from geometry_msgs.msg import TransformStamped, TwistStamped
from messages import LATCHED
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage, LaserScan

TOPICS = {
    "/clock": Clock,
    "/map": OccupancyGrid,
    "/odom": Odometry,
    "/scan": LaserScan,
    "/cmd_vel": TwistStamped,
    "/plan": Path,
    "/rosout": Log,
}
CAMERA = {"/camera/image/compressed": CompressedImage}
TRANSFORMS = {"/transforms": "/tf", "/transforms_static": "/tf_static"}
TRANSFORM, TRANSFORMS_TYPE = "geometry_msgs/msg/TransformStamped", "tf2_msgs/msg/TFMessage"


class Recorder(Node):
    """Writes the folder of a bag until it is closed."""

    def __init__(self, folder: FilePath, camera: bool = False) -> None:
        super().__init__("recorder")
        self.types = get_typestore(Stores.ROS2_JAZZY)
        self.writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self.writer.open()
        self.now = 0
        for topic, kind in {**TOPICS, **(CAMERA if camera else {})}.items():
            self.record(topic, kind, topic, f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}")
        for topic, recorded in TRANSFORMS.items():
            self.record(topic, TransformStamped, recorded, TRANSFORMS_TYPE)

    def record(self, topic: str, kind: type, recorded: str, type_: str) -> None:
        connection = self.writer.add_connection(recorded, type_, typestore=self.types)

        def take(data: bytes) -> None:
            content = self.as_message(data) if type_ == TRANSFORMS_TYPE else data
            if kind is not Log:  # whose stamps are of the machine's clock
                self.now = stamp(data)
            self.writer.write(connection, self.now, content)

        self.create_subscription(kind, topic, take, LATCHED, raw=True)

    def as_message(self, data: bytes) -> bytes:
        transform = self.types.deserialize_cdr(data, TRANSFORM)
        message = self.types.types[TRANSFORMS_TYPE]([transform])
        return bytes(self.types.serialize_cdr(message, TRANSFORMS_TYPE))

    def close(self) -> None:
        self.writer.close()


def stamp(data: bytes) -> int:
    """Time of a message [ns]; all that are recorded begin with it, behind 4 bytes of encoding."""
    seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
    return int(seconds * 10**9 + nanoseconds)
