#!/usr/bin/env python3
"""Drives a simulated robot to its goal, with nodes of ROS 2 that record what they say.

Exit code 0 at the goal, 1 elsewhere; `rosbag2` and `outcome.csv` are written to the output folder.
The same ROBOVAST_SEED is the same drive.
"""

from __future__ import annotations

import ast
import csv
import math
import os
import re
import socket
import sys
from pathlib import Path

import rclpy
from camera import Camera, CameraError
from follower import Follower
from grid import Grid
from rclpy.experimental import EventsExecutor
from recorder import Recorder
from simulator import Simulator
from traffic import connect
from world import STEP, World

DOMAINS = range(1, 102)
"""Those that every Linux has free ports for."""
MEMORY = 2.0
"""How long the robot believes what its laser saw, where others move [s]."""


def main() -> int:
    given = options(sys.argv[1:])
    output = Path(given["output"])
    start, goal = (place(ast.literal_eval(given[name])) for name in ("start", "goal"))
    radius = float(given["diameter"]) / 2
    seed = int(os.environ.get("ROBOVAST_SEED", "0"))
    grid = Grid.read(Path(given["map"]))
    boxes = [
        (place(obstacle["spawn_pose"]), *size(obstacle))
        for obstacle in ast.literal_eval(given["obstacles"])
    ]
    ends = [float(word) for word in given.get("traffic", "").split()]
    world = World(grid, boxes, start, radius, seed, tuple(ends[:2]) or None)
    traffic = ends and connect(
        seed=seed,
        ends=[ends[:2], ends[2:]],
        speed=float(given["traffic_speed"]),
        courtesy=float(given["courtesy"]),
    )
    lock, domain = own_domain()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rclpy.init(args=["--ros-args", "--disable-external-lib-logs"], domain_id=domain)
    camera, lack = look(world, float(given.get("camera", 0)))
    recorder = Recorder(output / "rosbag2", camera is not None)
    memory = MEMORY if ends else math.inf
    follower = Follower(goal, radius + float(given["margin"]), float(given["speed"]), memory)
    limit, pace = float(given["limit"]), float(given["pace"])
    simulator = Simulator(grid, world, goal, limit, pace, traffic, camera)
    if lack:
        simulator.get_logger().warning(lack)
    executor = EventsExecutor()
    for node in (recorder, follower, simulator):
        executor.add_node(node)
    try:
        while not (simulator.outcome or follower.outcome):
            executor.spin_once()
        for _ in range(20):  # the recorder takes what was said last
            executor.spin_once(timeout_sec=0.01)
    finally:
        recorder.close()
        lock.close()
        if camera:
            camera.close()
    outcome = simulator.outcome or follower.outcome
    x, y, _ = simulator.places[-1]
    told = {
        "outcome": outcome,
        "seconds": round(simulator.steps * STEP, 1),
        "x": round(x, 3),
        "y": round(y, 3),
        "seed": seed,
        "trajectory": simulator.trajectory,
    }
    with (output / "outcome.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, told)
        table.writeheader()
        table.writerow(told)
    return 0 if outcome == "arrived" else 1


def look(world: World, rate: float) -> tuple[Camera | None, str]:
    """The camera, if it is to take pictures, or why it takes none."""
    try:
        return (Camera(world, rate), "") if rate > 0 else (None, "")
    except CameraError as error:
        return None, f"no pictures of the camera: {error}"


def own_domain() -> tuple[socket.socket, int]:
    """A ROS domain that no other run on this machine uses, while the socket is open."""
    for domain in DOMAINS:
        lock = socket.socket(socket.AF_UNIX)
        try:
            lock.bind(f"\0ros_domain/{domain}")
        except OSError:
            lock.close()
        else:
            return lock, domain
    raise SystemExit("no ROS domain is free: too many runs at a time on this machine")


def options(words: list[str]) -> dict[str, str]:
    """`--name value value …` by name; a value may be any number of words."""
    found: dict[str, list[str]] = {}
    for word in words:
        if word.startswith("--"):
            found[word[2:]] = values = []
        else:
            values.append(word)
    return {name: " ".join(values) for name, values in found.items()}


def place(pose) -> tuple[float, float, float]:
    """x, y, yaw [m, rad]."""
    return tuple(
        float(value)
        for value in (
            pose["position"]["x"],
            pose["position"]["y"],
            pose.get("orientation", {}).get("yaw", 0.0),
        )
    )


def size(obstacle) -> tuple[float, float]:
    """Length and width of an obstacle [m]."""
    found = dict(re.findall(r"(\w+):=([0-9.]+)", obstacle["xacro_arguments"]))
    return float(found["length"]), float(found["width"])


if __name__ == "__main__":
    sys.exit(main())
