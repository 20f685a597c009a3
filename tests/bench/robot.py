#!/usr/bin/env python3
"""How fast the robot of the example robot_navigation drives, what for, and how alike.

    python tests/bench/robot.py [--repeat 3] [--same 100] [--beside 1]

Executes four drives of the example, each with the same commands in five ways, in turns: the physics
and the laser alone; with the pilot; with the nodes of ROS 2; with the recorder, as a run does it;
with five pictures a second of its camera, too.
Prints CPU seconds of their loops, without the start of Python and ROS, and simulated seconds per
CPU second. Then one drive again and again, each in a process, some beside each other: how many
trajectories there are. `--repeat 0` and `--same 0` leave one of the two out.
"""

from __future__ import annotations

import argparse
import ast
import csv
import json
import os
import statistics
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "configs" / "examples" / "robot_navigation"
VAST = Path(sys.executable).with_name("vast")
DRIVES = ("drive-1-1-1-2", "drive-1-2-1-2", "drive-2-1-1-2", "drive-2-2-1-2")
CASES = ("physics", "pilot", "nodes", "recorder", "camera")
SEED = 1


def options(generated: Path, drive: str, output: Path) -> list[str]:
    """Arguments of navigate.py."""
    own = generated / drive / "_config"
    told = yaml.safe_load((own / "scenario.config").read_text())["navigate"]
    given = {"speed": 0.8, "diameter": 0.4, "pace": 0, "limit": 60, **told}
    words = {name.removesuffix("_pose"): value for name, value in given.items()}
    words |= {"map": own / given["map_file"], "output": output}
    return [str(word) for name, value in words.items() for word in (f"--{name}", value)]


def child(case: str, words: list[str]) -> None:
    """Drive, and print CPU seconds of the loop and simulated seconds."""
    sys.path.insert(0, str(EXAMPLE / "files"))
    from grid import Grid
    from navigate import options as parsed
    from navigate import place, size
    from pilot import Pilot
    from world import ANGLES, STEP, World

    given: dict[str, Any] = parsed(words)
    start, goal = (place(ast.literal_eval(given[name])) for name in ("start", "goal"))
    grid, radius = Grid.read(Path(given["map"])), float(given["diameter"]) / 2
    boxes = [(place(box["spawn_pose"]), *size(box)) for box in ast.literal_eval(given["obstacles"])]
    world = World(grid, boxes, start, radius, SEED)
    if case in ("nodes", "recorder", "camera"):
        seconds, steps = nodes(case, given, grid, world, goal)
    else:
        pilot = Pilot(grid, goal, radius + float(given["margin"]), float(given["speed"]))
        commands = []
        begin = time.process_time()
        while ((world.place()[0] - goal[0]) ** 2 + (world.place()[1] - goal[1]) ** 2) ** 0.5 > 0.2:
            pilot.plan(world.place(), world.ranges(), ANGLES)
            commands.append(pilot.steer(world.place()))
            world.move(*commands[-1])
        seconds = time.process_time() - begin
        if case == "physics":
            world = World(grid, boxes, start, radius, SEED)
            begin = time.process_time()
            for command in commands:
                world.ranges()
                world.move(*command)
            seconds = time.process_time() - begin
        steps = len(commands)
    print(json.dumps([seconds, steps * STEP]))


def nodes(case: str, given: dict[str, Any], grid: Any, world: Any, goal: Any) -> tuple[float, int]:
    """CPU seconds and steps of a drive by nodes."""
    import rclpy
    from camera import Camera
    from follower import Follower
    from navigate import own_domain
    from rclpy.experimental import EventsExecutor
    from recorder import Recorder
    from simulator import Simulator

    lock, domain = own_domain()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rclpy.init(args=["--ros-args", "--disable-external-lib-logs"], domain_id=domain)
    camera = Camera(world, 5.0) if case == "camera" else None
    bag = Path(given["output"]) / "rosbag2"
    recorder = None if case == "nodes" else Recorder(bag, camera is not None)
    clearance = float(given["diameter"]) / 2 + float(given["margin"])
    follower = Follower(goal, clearance, float(given["speed"]))
    simulator = Simulator(grid, world, goal, 60.0, 0.0, camera=camera)
    executor = EventsExecutor()
    for node in (recorder, follower, simulator):
        if node:
            executor.add_node(node)
    begin = time.process_time()
    while not (simulator.outcome or follower.outcome):
        executor.spin_once()
    seconds = time.process_time() - begin
    if recorder:
        recorder.close()
    lock.close()
    return seconds, simulator.steps


def measured(python: Path, generated: Path, repeat: int) -> dict[str, list[tuple[float, float]]]:
    """By case, CPU and simulated seconds of all drives, for each repetition."""
    found: dict[str, list[tuple[float, float]]] = {case: [] for case in CASES}
    for _ in range(repeat):
        for case in CASES:
            times = []
            for drive in DRIVES:
                with TemporaryDirectory() as out:
                    command = [python, __file__, "--child", case]
                    command += options(generated, drive, Path(out))
                    done = subprocess.run(command, capture_output=True, text=True, check=True)
                times.append(json.loads(done.stdout.splitlines()[-1]))
            found[case].append((sum(t[0] for t in times), sum(t[1] for t in times)))
    return found


def trajectories(python: Path, generated: Path, count: int, beside: int) -> Counter[str]:
    """How often each trajectory came of one drive with one seed."""
    environment = {**os.environ, "ROBOVAST_SEED": str(SEED)}

    def drive(_: int) -> str:
        with TemporaryDirectory() as out:
            words = options(generated, DRIVES[-1], Path(out))
            command = [python, EXAMPLE / "files" / "navigate.py", *words]
            subprocess.run(command, capture_output=True, check=True, env=environment)
            (row,) = csv.DictReader((Path(out) / "outcome.csv").read_text().splitlines())
        return row["trajectory"]

    with ThreadPoolExecutor(beside) as pool:
        return Counter(pool.map(drive, range(count)))


def tell(found: dict[str, list[tuple[float, float]]]) -> None:
    """Print what the cases cost."""
    base = statistics.median(cpu for cpu, _ in found["physics"])
    for case, times in found.items():
        cpus = sorted(cpu for cpu, _ in times)
        cpu = statistics.median(cpus)
        print(
            f"{case}: {cpu:.2f} s [{cpus[0]:.2f}–{cpus[-1]:.2f}] of CPU, {cpu / base:.2f} of"
            f" physics, {times[0][1] / cpu:.0f} simulated seconds per CPU second"
        )


def main() -> None:
    """Print what was measured."""
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], sys.argv[3:])
        return
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--same", type=int, default=100)
    parser.add_argument("--beside", type=int, default=1)
    given = parser.parse_args()
    made = subprocess.run(
        [ROOT / "scripts" / "ros-environment"],
        env={**os.environ, "PYTHON": sys.executable},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    python = Path(made.stdout.strip()) / "bin" / "python"
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # it makes each start compile all again
    with TemporaryDirectory(prefix="robovast-bench-") as name:
        generated = Path(name) / "generated"
        command = [VAST, "-V", EXAMPLE / "robot_navigation.vast", "config", "generate", generated]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        if given.repeat:
            tell(measured(python, generated, given.repeat))
        if given.same:
            began = os.getloadavg()[0]
            same = trajectories(python, generated, given.same, given.beside)
            load = f"load {began:.0f} to {os.getloadavg()[0]:.0f} on {os.cpu_count()} CPUs"
            print(
                f"{given.same} drives with one seed, {load}: {len(same)} trajectories {dict(same)}"
            )


if __name__ == "__main__":
    main()
