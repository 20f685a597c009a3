#!/usr/bin/env python3
"""How long drawing paths and making floor plans takes.

    python tests/bench/navigation.py [--repeat 5]

Prints wall time, median first, least and largest in brackets, and behind it the median of the
CPU time, which other work on the machine does not change:

- 1,000 configurations of PathVariationRandom on a map of 400 × 400 cells with 16 rooms, and the
  same over 1,000 shortest ways by Dijkstra's algorithm on the full grid, which is what finding one
  way for each costs at least without a coarser lattice;
- a floor plan to map, mesh and graph, in this process, and the whole command `vast config list`
  with one floor plan over `vast config list` without.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from robovast.base.serialization import dump_yaml
from robovast.model.document import load_document
from robovast.model.expansion import expand
from robovast.navigation.costmap import Costmap
from robovast.navigation.floorplan.artefacts import make_artefacts
from robovast.navigation.floorplan.language import read_floorplan
from robovast.navigation.occupancy import OccupancyMap, write_map

EXAMPLE = Path(__file__).parents[2] / "configs" / "examples" / "floor_plans"
VAST = Path(sys.executable).with_name("vast")
CONFIGURATIONS = 1000
WAYS = 20
"""Ways on the full grid that stand for CONFIGURATIONS."""

SCENARIO = """\
scenario drive:
    map_file: string = ""
    mesh_file: string = ""
    start_pose: pose_3d
    goal_poses: list of pose_3d
    do serial:
        wait elapsed(1s)
"""


def rooms() -> OccupancyMap:
    """20 × 20 m in cells of 5 cm: 16 rooms with doors of 1 m."""
    free = np.zeros((400, 400), bool)
    free[2:-2, 2:-2] = True
    for wall in (100, 200, 300):
        free[wall - 2 : wall + 2] = free[:, wall - 2 : wall + 2] = False
    for wall in (100, 200, 300):
        for door in (50, 150, 250, 350):
            free[wall - 2 : wall + 2, door - 10 : door + 10] = True
            free[door - 10 : door + 10, wall - 2 : wall + 2] = True
    return OccupancyMap(free, ~free, 0.05)


def document(folder: Path, variation: dict[str, object] | None) -> Path:
    """A .vast file of one variation, or of none."""
    (folder / "drive.osc").write_text(SCENARIO)
    entry = {"name": "hall", **({"variations": [variation]} if variation else {})}
    data = {
        "version": 1,
        "configuration": [entry],
        "execution": {"scenario_file": "drive.osc"},
    }
    path = folder / "drive.vast"
    path.write_text(dump_yaml(data))
    return path


Times = tuple[float, float]
"""Wall time and CPU time of this process [s]."""


def clock() -> Times:
    return time.perf_counter(), time.process_time()


def since(begin: Times) -> Times:
    wall, cpu = clock()
    return wall - begin[0], cpu - begin[1]


def paths(folder: Path, start: object, goals: int) -> Times:
    """Expansion of CONFIGURATIONS paths."""
    write_map(rooms(), folder / "rooms.yaml")
    parameters = {
        "start_pose": start,
        "goal_poses": "@goal_poses",
        "map_file": "rooms.yaml",
        "path_length": 10.0,
        "num_goal_poses": goals,
        "num_paths": CONFIGURATIONS,
        "seed": 1,
    }
    path = document(folder, {"PathVariationRandom": parameters})
    with TemporaryDirectory() as work:
        begin = clock()
        variants = expand(load_document(path), Path(work))
        times = since(begin)
    assert len(variants) == CONFIGURATIONS
    return times


def full_grid() -> Times:
    """Ways from CONFIGURATIONS places on the full grid, from those of a few."""
    lattice = Costmap(rooms(), 0.35).finest
    step = len(lattice.points) // WAYS
    begin = clock()
    for number in range(WAYS):
        lattice.ways_from(number * step)
    wall, cpu = since(begin)
    return wall * CONFIGURATIONS / WAYS, cpu * CONFIGURATIONS / WAYS


def floor_plan(folder: Path) -> Times:
    """The example's office to all its files."""
    begin = clock()
    make_artefacts(read_floorplan(EXAMPLE / "plans" / "office.fpm"), "office", folder)
    return since(begin)


def listing(folder: Path, *plans: str) -> Times:
    """The command `vast config list`."""
    files = [str(EXAMPLE / "plans" / plan) for plan in plans]
    variation = {"FloorplanGeneration": {"name": ["map_file", "mesh_file"], "floorplans": files}}
    path = document(folder, variation if plans else None)
    begin, before = time.perf_counter(), os.times()
    subprocess.run([VAST, "-V", path, "config", "list"], check=True, capture_output=True)
    wall, after = time.perf_counter() - begin, os.times()
    cpu = after.children_user + after.children_system
    return wall, cpu - before.children_user - before.children_system


def measured(repeat: int, *cases: Callable[[Path], Times]) -> list[list[Times]]:
    """Times of each case; the cases take turns."""
    found: list[list[Times]] = [[] for _ in cases]
    for _ in range(repeat):
        for times, case in zip(found, cases, strict=True):
            with TemporaryDirectory(prefix="robovast-bench-") as folder:
                times.append(case(Path(folder)))
    return found


def shown(times: list[Times]) -> str:
    walls = [wall for wall, _ in times]
    median = f"{statistics.median(walls):.3f} s [{min(walls):.3f}–{max(walls):.3f}]"
    return f"{median}, CPU {cpu_of(times):.3f} s"


def cpu_of(times: list[Times]) -> float:
    return statistics.median(cpu for _, cpu in times)


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    repeat = parser.parse_args().repeat
    grid, drawn, fixed, several = measured(
        repeat,
        lambda _: full_grid(),
        lambda folder: paths(folder, "@start_pose", 1),
        lambda folder: paths(folder, {"x": 2.5, "y": 2.5}, 1),
        lambda folder: paths(folder, "@start_pose", 3),
    )
    for name, times in (
        ("start and goal drawn", drawn),
        ("start given", fixed),
        ("3 goals", several),
    ):
        ratio = cpu_of(times) / cpu_of(grid)
        print(
            f"{CONFIGURATIONS} paths of 10 m, {name}: {shown(times)}, {ratio:.3f} of the full grid"
        )
    plan, bare, listed = measured(
        repeat, floor_plan, listing, lambda folder: listing(folder, "office.fpm")
    )
    print(f"floor plan to map, mesh and graph: {shown(plan)}")
    ratio = cpu_of(listed) / cpu_of(bare)
    print(f"`vast config list` with it: {shown(listed)}, {ratio:.2f} × without")


if __name__ == "__main__":
    main()
