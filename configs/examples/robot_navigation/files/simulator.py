"""The simulated world as a node: publishes what the robot measures, takes its commands."""

from __future__ import annotations

import hashlib
import math
import struct
import time
from array import array

from geometry_msgs.msg import TransformStamped, TwistStamped
from grid import Grid
from messages import LATCHED, header, pose, transform
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage, LaserScan
from world import ANGLES, RANGE, STEP, World

CAMERA = "camera/image/compressed"
TOLERANCE = 0.2
"""Distance at which the goal counts as reached [m]."""
BUMP = 60.0
"""Force on the hull that counts as a collision; pushing a box slowly takes 40 [N]."""
PATIENCE = 100
"""Steps after which a robot that did not move by 0.1 m is stuck."""


class Simulator(Node):
    """Waits for the command of each step, so a drive is the same on every machine.

    `outcome` is empty until the run is over: `arrived`, or why it is not. `trajectory` is a hash
    of all places. `traffic` says how a second robot moves, if there is one. With a `pace` above 0,
    that many simulated seconds pass in a second at most. With a `camera`, what it sees is
    published at every so many steps.
    """

    def __init__(
        self, grid: Grid, world: World, goal, limit: float, pace: float, traffic=None, camera=None
    ) -> None:
        super().__init__("simulator")
        self.traffic, self.camera = traffic, camera
        self.world, self.goal, self.limit, self.pace = world, goal, limit, pace
        self.steps, self.began = 0, time.monotonic()
        self.places = [world.place()]
        self.outcome = ""
        self.clock = self.create_publisher(Clock, "clock", LATCHED)
        self.odometry = self.create_publisher(Odometry, "odom", LATCHED)
        self.scan = self.create_publisher(LaserScan, "scan", LATCHED)
        self.moving = self.create_publisher(TransformStamped, "transforms", LATCHED)
        self.fixed = self.create_publisher(TransformStamped, "transforms_static", LATCHED)
        self.map = self.create_publisher(OccupancyGrid, "map", LATCHED)
        self.pictures = camera and self.create_publisher(CompressedImage, CAMERA, LATCHED)
        self.create_subscription(TwistStamped, "cmd_vel", self.drive, LATCHED)
        self.map.publish(map_message(grid))
        self.fixed.publish(transform("map", "odom", 0.0))
        self.fixed.publish(transform("base_link", "laser", 0.0))
        self.tell()

    @property
    def trajectory(self) -> str:
        numbers = [number for place in self.places for number in place]
        return hashlib.sha256(struct.pack(f"<{len(numbers)}d", *numbers)).hexdigest()[:16]

    def drive(self, command: TwistStamped) -> None:
        """Move for one step, then look."""
        if self.outcome:
            return
        second = ()
        if self.traffic:
            both = self.world.second_place(), self.places[-1][:2]
            second = self.traffic(self.steps * STEP, *both)
        self.world.move(command.twist.linear.x, command.twist.angular.z, second)
        self.steps += 1
        self.places.append(self.world.place())
        if self.pace:
            due = self.began + self.steps * STEP / self.pace
            time.sleep(max(0.0, due - time.monotonic()))
        self.tell()
        self.outcome = self.judge()
        if self.outcome:
            x, y, _ = self.places[-1]
            say = self.get_logger().info if self.outcome == "arrived" else self.get_logger().error
            say(f"{self.outcome} after {self.steps * STEP:.1f} s at {x:.2f}, {y:.2f}")

    def judge(self) -> str:
        here = self.places[-1][:2]
        if self.world.push > BUMP:
            return "collision"
        if math.dist(here, self.goal[:2]) <= TOLERANCE:
            return "arrived"
        if self.steps >= PATIENCE and math.dist(here, self.places[-PATIENCE][:2]) < 0.1:
            return "stuck"
        return "too late" if self.steps * STEP >= self.limit else ""

    def tell(self) -> None:
        """Publish the time, where the robot is and what it sees."""
        now, (x, y, yaw) = self.steps * STEP, self.places[-1]
        self.clock.publish(Clock(clock=header("", now).stamp))
        odometry = Odometry(header=header("odom", now), child_frame_id="base_link")
        odometry.pose.pose = pose(x, y, yaw)
        odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = self.world.speeds()
        self.odometry.publish(odometry)
        self.moving.publish(transform("odom", "base_link", now, x, y, yaw))
        scan = LaserScan(
            header=header("laser", now),
            angle_min=float(ANGLES[0]),
            angle_max=float(ANGLES[-1]),
            angle_increment=float(ANGLES[1] - ANGLES[0]),
            range_max=RANGE,
            ranges=array("f", self.world.ranges()),
        )
        self.scan.publish(scan)
        if self.camera and self.steps % self.camera.every == 0:
            picture = CompressedImage(header=header("camera", now), format="jpeg")
            picture.data = array("B", self.camera.picture())
            self.pictures.publish(picture)


def map_message(grid: Grid) -> OccupancyGrid:
    height, width = grid.occupied.shape
    info = MapMetaData(
        resolution=grid.resolution, width=width, height=height, origin=pose(*grid.origin, 0.0)
    )
    cells = (grid.occupied.astype("int8") * 100).ravel()
    return OccupancyGrid(header=header("map", 0.0), info=info, data=cells.tolist())
