"""Publishes and records with nodes of ROS 2; runs where rclpy is installed.

    python ros_recorder.py

Prints, as lines of JSON, what a subscriber received: first `{topic, type, definition}` of every
topic, then `{topic, time, data, values}` of every message: its bytes (base64) and its fields, as
rclpy deserializes them.
"""

import base64
import json
import math
import sys
import time
from pathlib import Path

import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CompressedImage, JointState, LaserScan

from rosbags_common import gen_msg_values

COUNT = 20
TYPES = {
    "/odom": Odometry,
    "/scan": LaserScan,
    "/plan": PathMessage,
    "/joint_states": JointState,
    "/camera/image_raw/compressed": CompressedImage,
    "/rosout": Log,
}


def name_of(kind):
    return f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"


def definition(name):
    """The text that a recorder stores: a type's own definition, then those of all in it."""
    texts, wanted = {}, [name]
    while wanted:
        name = wanted.pop()
        if name in texts:
            continue
        package, _, short = name.split("/")
        file = Path(sys.prefix) / "share" / package / "msg" / f"{short}.msg"
        texts[name] = file.read_text()
        for line in texts[name].splitlines():
            field = line.split("#")[0].split()
            kind = field[0].split("[")[0] if len(field) > 1 and "=" not in line else ""
            if kind[:1].isupper() or "/" in kind:
                full = kind if "/" in kind else f"{package}/{kind}"
                wanted.append("{}/msg/{}".format(*full.split("/")))
    own, *others = texts.items()
    parts = [own[1]]
    for other, text in others:
        package, _, short = other.split("/")
        parts.append(f"{'=' * 80}\nMSG: {package}/{short}\n{text}")
    return "\n".join(parts)


def messages(number, stamp):
    odometry = Odometry(child_frame_id="base_link")
    odometry.header.stamp = stamp
    odometry.header.frame_id = 'a "frame", odd\nname'
    odometry.pose.pose.position.x = number / 7
    odometry.pose.covariance[7] = math.nan
    odometry.twist.twist.linear.x = -math.inf
    scan = LaserScan(ranges=[0.1 * number, math.inf, math.nan, 3.3], angle_min=-0.1)
    scan.intensities = [float(ray) / 3 for ray in range(number % 3)]
    plan = PathMessage(poses=[PoseStamped() for _ in range(number % 4)])
    for at, pose in enumerate(plan.poses):
        pose.pose.position.y = at / 3
        pose.header.frame_id = f"frame {at}"
    joints = JointState(name=["left", "rïght", ""][: number % 4], position=[1e-9, 1e300])
    image = CompressedImage(format="jpeg", data=[255, 0, number])
    return {
        "/odom": odometry,
        "/scan": scan,
        "/plan": plan,
        "/joint_states": joints,
        "/camera/image_raw/compressed": image,
    }


def main():
    rclpy.init()
    node = Node("recorder")
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    received = []
    for topic, kind in TYPES.items():
        note = {"topic": topic, "type": name_of(kind), "definition": definition(name_of(kind))}
        print(json.dumps(note))

        def take(data, topic=topic):
            received.append((topic, time.time_ns(), data))

        node.create_subscription(kind, topic, take, latched, raw=True)
    own = {topic: kind for topic, kind in TYPES.items() if topic != "/rosout"}
    publishers = {topic: node.create_publisher(kind, topic, latched) for topic, kind in own.items()}
    for number in range(COUNT):
        for topic, message in messages(number, node.get_clock().now().to_msg()).items():
            publishers[topic].publish(message)
        node.get_logger().warning(f'step {number}, "so far"')
        rclpy.spin_once(node, timeout_sec=0.01)
    end = time.monotonic() + 20
    while len(received) < COUNT * len(TYPES) and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    for topic, at, data in received:
        values = dict(gen_msg_values(deserialize_message(data, TYPES[topic])))
        text = base64.b64encode(data).decode()
        print(json.dumps({"topic": topic, "time": at, "data": text, "values": values}))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
