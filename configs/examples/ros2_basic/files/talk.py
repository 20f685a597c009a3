#!/usr/bin/env python3
"""A talker and a listener; exit code 0 when every message was heard."""

from __future__ import annotations

import argparse
import csv
import os
import socket
import sys
import time
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

DEPTH = 10
"""How many messages may wait."""
PATIENCE = 5.0
"""How long the listener waits for what is missing [s]."""


class Talker(Node):
    """Says a number at every tick."""

    def __init__(self, count: int, rate: float) -> None:
        super().__init__("talker")
        self.count, self.said = count, 0
        self.publisher = self.create_publisher(String, "chatter", DEPTH)
        self.create_timer(1 / rate, self.talk)

    def talk(self) -> None:
        if self.said < self.count and self.publisher.get_subscription_count():
            self.publisher.publish(String(data=f"{self.said} {time.monotonic()}"))
            self.said += 1


class Listener(Node):
    """Writes down what it hears, and how long that took [s]."""

    def __init__(self) -> None:
        super().__init__("listener")
        self.heard: list[tuple[int, float]] = []
        self.create_subscription(String, "chatter", self.hear, DEPTH)

    def hear(self, message: String) -> None:
        number, said_at = message.data.split()
        self.heard.append((int(number), time.monotonic() - float(said_at)))


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int)
    parser.add_argument("--rate", type=float, help="[Hz]")
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    lock, domain = own_domain()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rclpy.init(args=["--ros-args", "--disable-external-lib-logs"], domain_id=domain)
    talker, listener = Talker(given.count, given.rate), Listener()
    executor = SingleThreadedExecutor()
    for node in (talker, listener):
        executor.add_node(node)
    end = time.monotonic() + PATIENCE + given.count / given.rate
    while len(listener.heard) < given.count and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    lock.close()
    with (given.output / "heard.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["number", "latency"])
        table.writerows(listener.heard)
    listener.get_logger().info(f"heard {len(listener.heard)} of {talker.said}")
    return 0 if len(listener.heard) == given.count else 1


def own_domain() -> tuple[socket.socket, int]:
    """A ROS domain that no other run on this machine uses, while the socket is open."""
    for domain in range(1, 102):
        lock = socket.socket(socket.AF_UNIX)
        try:
            lock.bind(f"\0ros_domain/{domain}")
        except OSError:
            lock.close()
        else:
            return lock, domain
    raise SystemExit("no ROS domain is free: too many runs at a time on this machine")


if __name__ == "__main__":
    sys.exit(main())
