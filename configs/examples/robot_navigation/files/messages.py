"""What the nodes say to each other: quality of service, times and poses."""

from __future__ import annotations

import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, TransformStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header

LATCHED = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Nothing is lost, also by who is discovered late."""


def header(frame: str, seconds: float) -> Header:
    """Of a message at a simulated time [s]."""
    nanoseconds = round(seconds * 1e9)
    stamp = Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return Header(frame_id=frame, stamp=stamp)


def pose(x: float, y: float, yaw: float) -> Pose:
    """In the plane [m, rad]."""
    message = Pose()
    message.position.x, message.position.y = x, y
    message.orientation.z, message.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return message


def place(message: Pose) -> tuple[float, float, float]:
    """x, y, yaw [m, rad]."""
    yaw = 2 * math.atan2(message.orientation.z, message.orientation.w)
    return message.position.x, message.position.y, yaw


def transform(parent: str, child: str, seconds: float, x=0.0, y=0.0, yaw=0.0) -> TransformStamped:
    """Of a frame in the plane [m, rad]."""
    message = TransformStamped(header=header(parent, seconds), child_frame_id=child)
    message.transform.translation.x, message.transform.translation.y = x, y
    message.transform.rotation = pose(x, y, yaw).orientation
    return message
