"""A robot with differential drive and a laser scanner, on an occupancy map."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import TransformStamped, TwistStamped
from grid import Grid
from messages import LATCHED, header, pose, transform
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

STEP = 0.1
"""Simulated time between two commands [s]."""
RAYS = 120
RANGE = 5.0
"""Of the laser [m]."""
TOLERANCE = 0.2
"""Distance at which the goal counts as reached [m]."""


class Simulator(Node):
    """Waits for the command of each step, so a run is the same on every machine.

    `outcome` is empty until the run is over: `arrived`, or why it is not.
    """

    def __init__(self, grid: Grid, world: Grid, start, goal, radius: float, limit: float) -> None:
        super().__init__("simulator")
        self.world, self.radius, self.limit = world, radius, limit
        self.x, self.y, self.yaw = start
        self.goal = goal
        self.steps = 0
        self.outcome = ""
        self.odometry = self.create_publisher(Odometry, "odom", LATCHED)
        self.scan = self.create_publisher(LaserScan, "scan", LATCHED)
        self.moving = self.create_publisher(TransformStamped, "transforms", LATCHED)
        self.fixed = self.create_publisher(TransformStamped, "transforms_static", LATCHED)
        self.map = self.create_publisher(OccupancyGrid, "map", LATCHED)
        self.create_subscription(TwistStamped, "cmd_vel", self.drive, LATCHED)
        self.map.publish(map_message(grid))
        self.fixed.publish(transform("map", "odom", 0.0))
        self.fixed.publish(transform("base_link", "laser", 0.0))
        self.tell(0.0, 0.0)

    def drive(self, command: TwistStamped) -> None:
        """Move for one step, then look."""
        if self.outcome:
            return
        speed, turn = command.twist.linear.x, command.twist.angular.z
        middle = self.yaw + turn * STEP / 2
        self.x += speed * STEP * math.cos(middle)
        self.y += speed * STEP * math.sin(middle)
        self.yaw = math.remainder(self.yaw + turn * STEP, math.tau)
        self.steps += 1
        self.tell(speed, turn)
        self.outcome = self.judge()
        if self.outcome:
            where = f"{self.outcome} after {self.steps * STEP:.1f} s at {self.x:.2f}, {self.y:.2f}"
            (self.get_logger().info if self.outcome == "arrived" else self.get_logger().error)(
                where
            )

    def judge(self) -> str:
        if self.world.touches(self.x, self.y, self.radius):
            return "collision"
        if math.dist((self.x, self.y), self.goal[:2]) <= TOLERANCE:
            return "arrived"
        return "too late" if self.steps * STEP >= self.limit else ""

    def tell(self, speed: float, turn: float) -> None:
        """Publish where the robot is and what it sees."""
        now = self.steps * STEP
        odometry = Odometry(header=header("odom", now), child_frame_id="base_link")
        odometry.pose.pose = pose(self.x, self.y, self.yaw)
        odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = speed, turn
        self.odometry.publish(odometry)
        self.moving.publish(transform("odom", "base_link", now, self.x, self.y, self.yaw))
        angles = np.linspace(-math.pi, math.pi, RAYS, endpoint=False)
        ranges = self.world.ranges(self.x, self.y, self.yaw + angles, RANGE)
        scan = LaserScan(
            header=header("laser", now),
            angle_min=-math.pi,
            angle_max=float(angles[-1]),
            angle_increment=math.tau / RAYS,
            range_max=RANGE,
            ranges=ranges.astype(np.float32),
        )
        self.scan.publish(scan)


def map_message(grid: Grid) -> OccupancyGrid:
    height, width = grid.occupied.shape
    info = MapMetaData(
        resolution=grid.resolution, width=width, height=height, origin=pose(*grid.origin, 0.0)
    )
    cells = np.where(grid.occupied, 100, 0).astype(np.int8).ravel()
    return OccupancyGrid(header=header("map", 0.0), info=info, data=cells.tolist())
