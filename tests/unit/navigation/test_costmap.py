"""Shortest ways for a round robot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robovast.base.errors import InputError
from robovast.navigation import costmap as costmap_module
from robovast.navigation.costmap import Costmap
from robovast.navigation.occupancy import OccupancyMap
from robovast.navigation.poses import length_of


def room(height: int = 200, width: int = 200) -> np.ndarray:
    free = np.zeros((height, width), bool)
    free[1:-1, 1:-1] = True
    return free


def costmap(free: np.ndarray, diameter: float = 0.2) -> Costmap:
    return Costmap(OccupancyMap(free, ~free, 0.05), diameter)


def test_a_way_in_the_open_is_straight() -> None:
    assert costmap(room()).shortest_path((1.0, 1.0), (7.0, 9.0)) == [(1.0, 1.0), (7.0, 9.0)]


def test_a_way_around_a_wall_touches_its_end() -> None:
    free = room()
    free[:100, 98:102] = False  # from y = 0 to y = 5, at x = 5
    way = costmap(free, 0.1).shortest_path((2.0, 2.0), (8.0, 2.0))
    assert way is not None
    taut = math.dist((2.0, 2.0), (4.9, 5.05)) + 0.2 + math.dist((5.1, 5.05), (8.0, 2.0))
    assert length_of(way) == pytest.approx(taut, rel=0.03)


@pytest.mark.parametrize("door", [1, 2, 3, 5, 9])
def test_no_door_is_too_narrow_that_the_robot_fits_through(door: int) -> None:
    free = room(400, 400)
    free[:, 200] = False
    free[203 : 203 + door, 200] = True
    way = costmap(free, 0.05).shortest_path((2.0, 15.0), (18.0, 15.0))
    assert way is not None
    assert costmap(free, 0.05 * door + 0.05).shortest_path((2.0, 15.0), (18.0, 15.0)) is None


def test_specks_do_not_make_a_large_map_slow() -> None:
    free = room(600, 600)
    free[::7, ::7] = False  # 7,000 specks, and as many islands
    free[300:304] = False
    free[301, ::3] = True
    lattice = costmap(free, 0.1).lattice
    assert 0 < len(lattice.points) <= free.sum()


def test_clearance_is_the_distance_to_the_nearest_wall() -> None:
    found = costmap(room())
    assert found.clearance_at((0.55, 5.0)) == pytest.approx(0.5, abs=0.05)
    assert found.clearance_at((-3.0, 5.0)) == 0.0
    assert not found.is_passable((0.1, 5.0))
    assert not found.is_passable((50.0, 5.0))


def test_further_obstacles_take_their_place_away() -> None:
    found = costmap(room())
    blocked = found.without([((5.0, 5.0), 1.0)])
    assert blocked.clearance_at((6.5, 5.0)) == pytest.approx(0.5, abs=0.05)
    assert not blocked.is_passable((5.9, 5.0))
    assert found.is_passable((5.9, 5.0))
    way = blocked.shortest_path((3.0, 5.0), (7.0, 5.0))
    assert way is not None
    assert length_of(way) > 4.3


@pytest.mark.parametrize("resolution", [0.25, 1.0])
def test_a_map_with_more_cells_than_memory_holds_is_refused(
    resolution: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(costmap_module, "_MOST_POSSIBLE", 3_000)
    free = room(60, 60)
    free[30, :50] = False
    large = Costmap(OccupancyMap(free, ~free, resolution), 0.2)
    place = 10 * resolution
    with pytest.raises(InputError, match=r"one of 3,315 free cells.*Use a map with larger cells"):
        large.shortest_path((place, place), (place, 50 * resolution))
