"""Plans a way to the goal on the map, follows it, and plans again when something is on it."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from grid import Grid, way
from messages import LATCHED, header, place, pose
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

AHEAD = 0.35
"""Distance of the point on the way that the robot turns to [m]."""
FASTEST_TURN = 1.5
"""[rad/s]"""


class Follower(Node):
    """Answers each scan with one command. `outcome` says why it gave up."""

    def __init__(self, goal, clearance: float, speed: float) -> None:
        super().__init__("follower")
        self.goal, self.clearance, self.speed = goal, clearance, speed
        self.grid: Grid | None = None
        self.at: Odometry | None = None
        self.seen: LaserScan | None = None
        self.way: list[tuple[float, float]] = []
        self.blocked = None
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
        self.grid = Grid(cells != 0, info.resolution, (origin.x, origin.y))
        self.blocked = self.grid.inflated(self.clearance)
        self.answer()

    def take_odometry(self, message: Odometry) -> None:
        self.at = message
        self.answer()

    def take_scan(self, message: LaserScan) -> None:
        self.seen = message
        self.answer()

    def answer(self) -> None:
        """Give one command when map, odometry and scan of a time are there."""
        if self.grid is None or self.at is None or self.seen is None or self.outcome:
            return
        if self.at.header.stamp != self.seen.header.stamp:
            return
        here = place(self.at.pose.pose)
        self.notice(here, self.seen)
        if not self.way or self.is_way_blocked():
            self.make_plan(here)
        command = TwistStamped()
        command.header.stamp = self.seen.header.stamp
        command.header.frame_id = "base_link"
        if self.way:
            command.twist.linear.x, command.twist.angular.z = self.steer(here)
        self.seen = None
        self.command.publish(command)

    def notice(self, here, scan: LaserScan) -> None:
        """Put what the laser hit on the grid."""
        ranges = np.array(scan.ranges)
        angles = here[2] + scan.angle_min + np.arange(len(ranges)) * scan.angle_increment
        near = ranges < scan.range_max
        right = here[0] + ranges[near] * np.cos(angles[near])
        up = here[1] + ranges[near] * np.sin(angles[near])
        new = ~self.grid.is_occupied(right, up)
        if new.any():
            self.grid.occupied[self.grid.cell(right[new], up[new])] = True
            self.blocked = self.grid.inflated(self.clearance)

    def is_way_blocked(self) -> bool:
        rows, columns = self.grid.cell(*np.array(self.way).T)
        return bool(self.blocked[rows, columns].any())

    def make_plan(self, here) -> None:
        start, goal = (
            tuple(int(part) for part in self.grid.cell(np.float64(x), np.float64(y)))
            for x, y, _ in (here, self.goal)
        )
        free = self.blocked.copy()
        rows, columns = np.indices(free.shape)
        near = np.hypot(rows - start[0], columns - start[1]) * self.grid.resolution
        free[(near < self.clearance) & ~self.grid.occupied] = False
        self.way = [self.grid.place(*cell) for cell in way(free, start, goal)]
        if not self.way:
            self.outcome = "no way to the goal"
            self.get_logger().error(f"{self.outcome} from {here[0]:.2f}, {here[1]:.2f}")
            return
        frame = header("map", 0.0)
        frame.stamp = self.seen.header.stamp
        poses = [PoseStamped(header=frame, pose=pose(x, y, 0.0)) for x, y in self.way]
        self.plan.publish(Path(header=frame, poses=poses))
        self.get_logger().info(f"a way of {len(self.way) * self.grid.resolution:.1f} m")

    def steer(self, here) -> tuple[float, float]:
        """Speed and turn [m/s, rad/s] towards a point ahead; what is behind is forgotten."""
        distances = [math.dist(here[:2], point) for point in self.way]
        self.way = self.way[distances.index(min(distances)) :]
        target = next((p for p in self.way if math.dist(here[:2], p) >= AHEAD), self.way[-1])
        bearing = math.atan2(target[1] - here[1], target[0] - here[0])
        error = math.remainder(bearing - here[2], math.tau)
        turn = max(-FASTEST_TURN, min(FASTEST_TURN, 2 * error))
        return self.speed * max(0.0, math.cos(error)) ** 2, turn
