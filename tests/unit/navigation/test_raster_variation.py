"""Paths on a raster: every one of a length, and only between points of the raster."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from robovast.base.errors import InputError
from robovast.navigation import raster
from robovast.navigation.occupancy import OccupancyMap, write_map
from robovast.navigation.poses import read_pose

START = {"x": 1.0, "y": 3.0}


def rasterized(**changes):
    parameters = {
        "start_pose": START,
        "map_file": "hall.yaml",
        "raster_size": 1.0,
        "path_length": 3.0,
        "robot_diameter": 0.3,
    }
    return {"PathVariationRasterized": {**parameters, **changes}}


def ends(composition) -> list[tuple[float, float]]:
    return [read_pose(v.parameters["goal_pose"]).point for v in composition.variants]


def test_every_point_at_the_length_is_a_goal(expanded) -> None:
    # In the left room ways are straight; its walls leave x from 1 to 4 and y from 1 to 5.
    wanted = {
        (float(x), float(y))
        for x in range(1, 5)
        for y in range(1, 6)
        if abs(math.hypot(x - 1, y - 3) - 3.0) <= 0.5
    }
    found = ends(expanded(rasterized()))
    assert set(found) == wanted
    assert len(found) == len(wanted)


def test_the_offset_moves_the_raster(expanded) -> None:
    points = ends(expanded(rasterized(raster_offset_x=0.25, raster_offset_y=-0.25)))
    assert {(round(x % 1, 3), round(y % 1, 3)) for x, y in points} == {(0.25, 0.75)}


def test_without_a_given_start_every_point_is_one(expanded) -> None:
    composition = expanded(rasterized(start_pose="@start_pose", raster_size=2.0, path_length=2.0))
    starts = {read_pose(v.parameters["start_pose"]).point for v in composition.variants}
    assert len(starts) > 2
    assert all(x % 2 == 0 and y % 2 == 0 for x, y in starts)


def test_all_ordered_pairs_of_a_hall_with_half_a_wall(expanded, folder: Path) -> None:
    free = np.zeros((120, 160), bool)
    free[3:-3, 3:-3] = True
    free[49:, 78:82] = False  # a wall at x = 0 from y = -0.55 up
    write_map(OccupancyMap(free, ~free, 0.05, (-4.0, -3.0)), folder / "hall.yaml")
    given = rasterized(
        raster_size=2.0, path_length=2.0, path_length_tolerance=0.3, robot_diameter=0.5
    )
    del given["PathVariationRasterized"]["start_pose"]
    made = [v.extra["_navigation"] for v in expanded(given).variants]
    pairs = [(read_pose(m["start"]).point, read_pose(m["goals"][0]).point) for m in made]
    assert pairs == [
        ((-2, -1), (0, -1)), ((-2, -1), (-2, 1)), ((0, -1), (-2, -1)), ((0, -1), (2, -1)),
        ((2, -1), (0, -1)), ((2, -1), (2, 1)), ((-2, 1), (-2, -1)), ((2, 1), (2, -1)),
    ]  # fmt: skip


def test_several_goals_share_the_length(expanded) -> None:
    composition = expanded(rasterized(num_goal_poses=2, path_length=[2.0, 3.0]))
    lengths = [v.extra["_navigation"]["path_length"] for v in composition.variants]
    assert all(min(abs(n - 2.0), abs(n - 3.0)) <= 0.5 for n in lengths)
    assert all(len(v.parameters["goal_poses"]) == 2 for v in composition.variants)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (
            {"path_length": 50.0},
            "configuration `hall`: PathVariationRasterized: hall.yaml: no path",
        ),
        ({"raster_size": -1.0}, "must be greater than 0"),
        ({"start_pose": {"x": 5.0, "y": 1.0}}, "is inside a wall"),
    ],
)
def test_what_cannot_be(expanded, changes, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        expanded(rasterized(**changes))


def test_more_paths_than_any_campaign_wants(expanded, monkeypatch) -> None:
    monkeypatch.setattr(raster, "MOST_PATHS", 20)
    with pytest.raises(InputError, match="gives more than 20 paths; use a wider"):
        expanded(rasterized(start_pose="@start_pose"))
