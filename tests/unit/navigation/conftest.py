"""A hall of two rooms with a door between them, and campaigns in it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robovast.base.serialization import dump_yaml
from robovast.model.document import load_document
from robovast.model.expansion import Composition, compose
from robovast.navigation.occupancy import OccupancyMap, write_map

SCENARIO = """\
import osc.robotics

scenario drive:
    map_file: string = ""
    mesh_file: string = ""
    start_pose: pose_3d
    goal_pose: pose_3d
    goal_poses: list of pose_3d
    obstacles: list of obstacle
    trigger_point: position_3d
    trigger_threshold: length = 0.0m
    do serial:
        wait elapsed(1s)
"""


def hall(door: int = 10) -> OccupancyMap:
    """10 × 6 m in cells of 5 cm, walls around, a wall at x = 5 with a door of `door` cells."""
    free = np.zeros((120, 200), bool)
    free[2:-2, 2:-2] = True
    free[:, 98:102] = False
    middle = 60
    free[middle - door // 2 : middle + (door + 1) // 2, 98:102] = True
    return OccupancyMap(free, ~free, 0.05)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a scenario and the map `hall.yaml`."""
    (tmp_path / "drive.osc").write_text(SCENARIO)
    write_map(hall(), tmp_path / "hall.yaml")
    return tmp_path


@pytest.fixture
def document(folder: Path) -> Callable[..., Path]:
    """Write a .vast file with one entry, `hall`, of the variations that are given."""

    def write(*variations: dict[str, Any]) -> Path:
        path = folder / "drive.vast"
        data = {
            "version": 1,
            "configuration": [{"name": "hall", "variations": list(variations)}],
            "execution": {"scenario_file": "drive.osc", "run_files": ["*.yaml"]},
        }
        path.write_text(dump_yaml(data))
        return path

    return write


@pytest.fixture
def expanded(document: Callable[..., Path], folder: Path) -> Callable[..., Composition]:
    """Expand a .vast file of the variations that are given."""

    def run(*variations: dict[str, Any]) -> Composition:
        work = folder / "work"
        work.mkdir(exist_ok=True)
        return compose(load_document(document(*variations)), work)

    return run
