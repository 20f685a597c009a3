"""The pilot as a node: answers each scan with one command."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from grid import Grid
from messages import LATCHED, header, place, pose
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from pilot import Pilot
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from world import STEP


class Follower(Node):
    """`outcome` says why it gave up."""

    def __init__(self, goal, clearance: float, speed: float, memory: float = math.inf) -> None:
        super().__init__("follower")
        self.goal, self.clearance, self.speed, self.memory = goal, clearance, speed, memory
        self.pilot: Pilot | None = None
        self.at: Odometry | None = None
        self.seen: LaserScan | None = None
        self.outcome = ""
        self.command = self.create_publisher(TwistStamped, "cmd_vel", LATCHED)
        self.plan = self.create_publisher(Path, "plan", LATCHED)
        self.create_subscription(OccupancyGrid, "map", self.take_map, LATCHED)
        self.create_subscription(Odometry, "odom", self.take_odometry, LATCHED)
        self.create_subscription(LaserScan, "scan", self.take_scan, LATCHED)

    def take_map(self, message: OccupancyGrid) -> None:
        info = message.info
        cells = np.array(message.data, np.int8).reshape(info.height, info.width)
        origin = info.origin.position
        grid = Grid(cells != 0, info.resolution, (origin.x, origin.y))
        steps = self.memory / STEP
        self.pilot = Pilot(grid, self.goal, self.clearance, self.speed, steps)
        self.answer()

    def take_odometry(self, message: Odometry) -> None:
        self.at = message
        self.answer()

    def take_scan(self, message: LaserScan) -> None:
        self.seen = message
        self.answer()

    def answer(self) -> None:
        """Give one command when map, odometry and scan of a time are there."""
        if self.pilot is None or self.at is None or self.seen is None or self.outcome:
            return
        if self.at.header.stamp != self.seen.header.stamp:
            return
        scan, here = self.seen, place(self.at.pose.pose)
        self.seen = None
        ranges = np.array(scan.ranges)
        angles = scan.angle_min + np.arange(len(ranges)) * scan.angle_increment
        if self.pilot.plan(here, ranges, angles):
            self.tell(here, scan.header.stamp)
        command = TwistStamped(header=header("base_link", 0.0))
        command.header.stamp = scan.header.stamp
        if self.pilot.way:
            command.twist.linear.x, command.twist.angular.z = self.pilot.steer(here)
        self.command.publish(command)

    def tell(self, here, stamp) -> None:
        """Publish the new way, or say that there is none.

        Where others move, the robot waits for one.
        """
        way, frame = self.pilot.way, header("map", 0.0)
        frame.stamp = stamp
        if not way:
            if math.isfinite(self.memory):
                return
            self.outcome = "no way to the goal"
            self.get_logger().error(f"{self.outcome} from {here[0]:.2f}, {here[1]:.2f}")
            return
        poses = [PoseStamped(header=frame, pose=pose(x, y, 0.0)) for x, y in way]
        self.plan.publish(Path(header=frame, poses=poses))
        self.get_logger().info(f"a way of {len(way) * self.pilot.grid.resolution:.1f} m")
