#!/usr/bin/env python3
"""What it costs to turn a bag into tables, beside only reading it.

    python tests/bench/bags.py [--megabytes 200] [--repeat 3]

Records an MCAP bag of transforms (100 Hz, three or four each), odometry (50 Hz) and laser scans
(10 Hz, 720 rays with intensities), without compression. Then, each in a process of its own and in
turns: the package `mcap` iterates over its messages, the package `rosbags` iterates and
deserializes, and we convert it: poses of a frame in `map`, odometry and scans as CSV. Prints CPU
seconds and their ratio (that of wall time depends on what else the machine does), messages and MB a
second, peak memory. Then two such bags by one process and by two.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.campaigns.bags import Bag

from robovast.analysis.bags import commands

BYTES_PER_SECOND = 128_000
"""Of the recording, roughly."""


def record(folder: Path, seconds: int) -> int:
    """Record a bag; the number of its messages."""
    chance = np.random.default_rng(1)
    count = 0
    with Bag(folder) as bag:
        fixed = [
            bag.transform("base_footprint", "base_link", 0, (0.0, 0.0, 0.1)),
            bag.transform("base_link", "laser", 0, (0.2, 0.0, 0.1)),
        ]
        bag.transforms(fixed, static=True)
        for step in range(seconds * 100):
            at = step / 100
            bag.write("/tf", transforms(bag, step), at)
            count += 1
            if step % 2 == 0:
                bag.write("/odom", odometry(bag, at, chance), at)
                count += 1
            if step % 10 == 0:
                bag.write("/scan", scan(bag, at, chance), at)
                count += 1
    return count + len(fixed)


def transforms(bag: Bag, step: int) -> object:
    at = step / 100
    place = (at, float(np.sin(at)), 0.0)
    moving = [
        bag.transform("odom", "base_footprint", at, place, yaw=at / 10),
        bag.transform("base_link", "wheel_left", at, (0.0, 0.2, 0.0), yaw=at * 3),
        bag.transform("base_link", "wheel_right", at, (0.0, -0.2, 0.0), yaw=at * 3.1),
    ]
    if step % 5 == 0:
        moving.append(bag.transform("map", "odom", at, (at / 100, 0.0, 0.0), yaw=at / 1000))
    return bag.make("tf2_msgs/msg/TFMessage", moving)


def odometry(bag: Bag, at: float, chance: np.random.Generator) -> object:
    make = bag.make
    covariance = np.zeros(36)
    covariance[::7] = chance.random(6)
    pose = make(
        "geometry_msgs/msg/Pose",
        make("geometry_msgs/msg/Point", at, float(np.sin(at)), 0.0),
        make("geometry_msgs/msg/Quaternion", 0.0, 0.0, float(np.sin(at)), float(np.cos(at))),
    )
    twist = make(
        "geometry_msgs/msg/Twist",
        make("geometry_msgs/msg/Vector3", float(np.cos(at)), 0.0, 0.0),
        make("geometry_msgs/msg/Vector3", 0.0, 0.0, float(np.sin(at / 3))),
    )
    return make(
        "nav_msgs/msg/Odometry",
        bag.header(at, "odom"),
        "base_footprint",
        make("geometry_msgs/msg/PoseWithCovariance", pose, covariance),
        make("geometry_msgs/msg/TwistWithCovariance", twist, covariance),
    )


def scan(bag: Bag, at: float, chance: np.random.Generator) -> object:
    ranges = (chance.random(720) * 20).astype(np.float32)
    ranges[ranges > 18] = np.inf
    intensities = (chance.random(720) * 1000).astype(np.float32)
    limits = (-3.14, 3.14, 0.0087, 0.0, 0.1, 0.1, 20.0)
    header = bag.header(at, "laser")
    return bag.make("sensor_msgs/msg/LaserScan", header, *limits, ranges, intensities)


def iterate_mcap(run: Path) -> None:
    from mcap.reader import make_reader

    with (run / "rosbag2" / "rosbag2.mcap").open("rb") as stream:
        for _ in make_reader(stream).iter_messages():
            pass


def deserialize_rosbags(run: Path) -> None:
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(run / "rosbag2") as reader:
        for connection, _, data in reader.messages():
            store.deserialize_cdr(data, connection.msgtype)


def convert(run: Path) -> None:
    from robovast.analysis.bags.convert import convert_run
    from robovast.model.document.commands import bag_command

    jobs = [
        bag_command("rosbags_tf_to_csv", {"frames": ["base_link"]}),
        bag_command("rosbags_to_csv", {"topics": ["/odom", "/scan"]}),
    ]
    convert_run(run, jobs)


TASKS: dict[str, Callable[[Path], None]] = {
    "mcap, iterate": iterate_mcap,
    "rosbags, iterate and deserialize": deserialize_rosbags,
    "convert to CSV": convert,
}


def measured(task: str, run: Path) -> tuple[float, float, float]:
    """Wall time [s], CPU time [s] and peak memory [MiB] of a task alone on one CPU."""
    command = [sys.executable, __file__, "--task", task, "--run", str(run)]
    result = subprocess.run(command, check=True, capture_output=True, text=True)
    wall, cpu, memory = map(float, result.stdout.split())
    return wall, cpu, memory


def one_task(task: str, run: Path) -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    begin, before = time.perf_counter(), time.process_time()
    TASKS[task](run)
    wall, cpu = time.perf_counter() - begin, time.process_time() - before
    print(wall, cpu, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def campaign(folder: Path, processors: int) -> tuple[float, float]:
    """Wall time and CPU time [s] of a command over two runs."""
    command = [sys.executable, __file__, "--processors", str(processors), "--run", str(folder)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin = time.perf_counter()
    subprocess.run(command, check=True)
    wall = time.perf_counter() - begin
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def one_campaign(folder: Path, processors: int) -> None:
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:processors])
    success, message, _ = commands.rosbags_to_csv(str(folder), str(folder), ["/odom", "/scan"])
    if not success:
        raise SystemExit(message)


def scale(folder: Path, repeat: int) -> None:
    copytree(folder / "0" / "rosbag2", folder / "1" / "rosbag2", copy_function=os.link)
    taken = [(campaign(folder, 1), campaign(folder, 2)) for _ in range(repeat)]
    walls = [statistics.median(pair[n][0] for pair in taken) for n in (0, 1)]
    cpus = [statistics.median(pair[n][1] for pair in taken) for n in (0, 1)]
    print(
        f"two bags: one process {walls[0]:.2f} s wall, {cpus[0]:.2f} s CPU; two processes "
        f"{walls[1]:.2f} s wall, {cpus[1]:.2f} s CPU: {walls[0] / walls[1]:.2f} times as fast"
    )


def compare(run: Path, messages: int, repeat: int) -> None:
    megabytes = sum(path.stat().st_size for path in (run / "rosbag2").iterdir()) / 1e6
    print(f"{megabytes:.0f} MB, {messages} messages, CPU seconds: median (least to largest)")
    taken: dict[str, list[tuple[float, float, float]]] = {task: [] for task in TASKS}
    for _ in range(repeat):
        for task, values in taken.items():
            values.append(measured(task, run))
    base = statistics.median(cpu for _, cpu, _ in taken["rosbags, iterate and deserialize"])
    for task, values in taken.items():
        times = sorted(cpu for _, cpu, _ in values)
        cpu = statistics.median(times)
        wall = statistics.median(wall for wall, _, _ in values)
        print(
            f"{task}: {cpu:.2f} s ({times[0]:.2f} to {times[-1]:.2f}), wall {wall:.2f} s, "
            f"ratio {cpu / base:.2f}, {messages / cpu:.0f} messages/s, {megabytes / cpu:.0f} MB/s, "
            f"{max(memory for _, _, memory in values):.0f} MiB"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=int, default=200)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--task", choices=TASKS, help=argparse.SUPPRESS)
    parser.add_argument("--run", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--processors", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.processors:
        one_campaign(arguments.run, arguments.processors)
        return
    if arguments.task:
        one_task(arguments.task, arguments.run)
        return
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        seconds = arguments.megabytes * 1_000_000 // BYTES_PER_SECOND
        messages = record(folder / "0" / "rosbag2", seconds)
        compare(folder / "0", messages, arguments.repeat)
        scale(folder, arguments.repeat)


if __name__ == "__main__":
    main()
