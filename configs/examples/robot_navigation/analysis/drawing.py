"""Pictures of drives for the notebooks, on the map of their configuration."""

from __future__ import annotations

from pathlib import Path

from IPython.display import SVG

from robovast.common.analysis import get_run_status, get_scenario_parameter, read_output_csv
from robovast.navigation.drawing import Line, marks, to_svg
from robovast.navigation.occupancy import read_map

PASSED, FAILED = "#1a7f37", "#cf222e"
BOX = 0.21
"""Radius of a disc that holds an obstacle [m]."""


def picture(config: Path, runs: list[Path]) -> SVG:
    """Where the robot drove in some runs of a configuration; those that failed in red."""
    occupancy = read_map(config / "_config" / get_scenario_parameter(config, "map_file"))
    boxes = get_scenario_parameter(config, "obstacles")
    drawn = {
        "start": get_scenario_parameter(config, "start_pose"),
        "goals": [get_scenario_parameter(config, "goal_pose")],
        "obstacles": [{**box["spawn_pose"]["position"], "radius": BOX} for box in boxes],
    }
    found = [*marks(drawn, {"obstacles": boxes}), *map(drive, runs)]
    return SVG(to_svg(occupancy, found, config.name))


def drive(run: Path) -> Line:
    poses = read_output_csv(run, "poses.csv")
    points = list(zip(poses["position.x"], poses["position.y"], strict=True))
    return Line(points, PASSED if get_run_status(run)[0] == "passed" else FAILED)
