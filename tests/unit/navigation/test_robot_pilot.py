"""The maps and the pilot of the example robot_navigation, which need no ROS and no physics."""

from __future__ import annotations

import importlib
import math
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from support.campaigns.local import EXAMPLES

ANGLES = np.linspace(-math.pi, math.pi, 120, endpoint=False)
NOTHING = np.full(120, np.inf)


@pytest.fixture(scope="module")
def grids() -> ModuleType:
    return module("grid")


@pytest.fixture(scope="module")
def pilots(grids: ModuleType) -> ModuleType:
    return module("pilot")


def module(name: str) -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXAMPLES / "robot_navigation" / "files")
        return importlib.import_module(name)


@given(arrays.arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_rectangles_are_all_occupied_cells_each_once(occupied) -> None:
    covered = np.zeros(occupied.shape, int)
    for top, left, bottom, right in module("grid").Grid(occupied, 0.05, (0, 0)).rectangles():
        covered[top : bottom + 1, left : right + 1] += 1
    assert (covered == occupied).all()


def room(grids: ModuleType, gap: float):
    """4 m × 4 m, with a wall that has a gap across the middle."""
    occupied = np.zeros((80, 80), bool)
    occupied[40] = True
    half = round(gap / 0.05 / 2)
    occupied[40, 40 - half : 40 + half] = False
    return grids.Grid(occupied, 0.05, (0.0, 0.0))


@pytest.mark.parametrize("radius", [0.05, 0.22, 0.3])
def test_a_resolution_that_a_message_rounded_does_not_change_what_is_free(
    grids: ModuleType, radius: float
) -> None:
    given, told = room(grids, 1.0), room(grids, 1.0)
    told.resolution = float(np.float32(given.resolution))
    assert (given.inflated(radius) == told.inflated(radius)).all()


@pytest.mark.parametrize(("gap", "passes"), [(0.9, True), (0.4, False)])
def test_a_pilot_takes_gaps_that_are_wide_enough(
    grids: ModuleType, pilots: ModuleType, gap: float, passes: bool
) -> None:
    pilot = pilots.Pilot(room(grids, gap), (2.0, 3.5, 0.0), clearance=0.3, speed=1.0)
    assert pilot.plan((2.0, 0.5, 0.0), NOTHING, ANGLES)
    assert bool(pilot.way) is passes


def test_a_pilot_plans_again_when_something_stands_on_its_way(
    grids: ModuleType, pilots: ModuleType
) -> None:
    pilot = pilots.Pilot(room(grids, 2.0), (2.0, 3.5, 0.0), clearance=0.3, speed=1.0)
    here = (2.0, 0.5, math.pi / 2)
    assert pilot.plan(here, NOTHING, ANGLES)
    assert not pilot.plan(here, NOTHING, ANGLES)
    box = NOTHING.copy()
    box[58:63] = 1.0
    assert pilot.plan(here, box, ANGLES)
    assert min(math.dist(point, (2.0, 1.5)) for point in pilot.way) > 0.3


def test_what_the_laser_sees_beside_a_wall_is_the_wall(
    grids: ModuleType, pilots: ModuleType
) -> None:
    pilot = pilots.Pilot(room(grids, 1.0), (2.0, 3.5, 0.0), clearance=0.3, speed=1.0)
    before = pilot.grid.occupied.copy()
    wall = NOTHING.copy()
    wall[60] = 1.49
    pilot.plan((0.5, 0.5, math.pi / 2), wall, ANGLES)
    assert (pilot.grid.occupied == before).all()
