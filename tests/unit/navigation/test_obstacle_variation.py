"""Obstacles: where they may be, how many, and when they appear."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import pytest
from shapely import LineString, Point

from robovast.base.errors import InputError
from robovast.navigation.costmap import Costmap
from robovast.navigation.occupancy import read_map
from robovast.navigation.poses import read_pose
from robovast.navigation.sizes import radius_of

START, GOAL = {"x": 1.0, "y": 3.0}, {"x": 9.0, "y": 3.0}
PATH = {
    "PathVariationRandom": {
        "start_pose": START,
        "goal_poses": [GOAL],
        "map_file": "hall.yaml",
        "path_length": 8.0,
    }
}
BOX = {"model": "box.sdf.xacro", "xacro_arguments": "width:=0.3, length:=0.4, height:=1.0"}


def obstacles(*kinds: dict[str, Any], **changes: Any) -> dict[str, Any]:
    configs = [{**BOX, **kind} for kind in kinds]
    return {"ObstacleVariation": {"name": "obstacles", "obstacle_configs": configs, **changes}}


def triggered(*kinds: dict[str, Any], **changes: Any) -> dict[str, Any]:
    parameters = obstacles(*kinds)["ObstacleVariation"]
    trigger = {
        "spawn_trigger_point": "@trigger_point",
        "spawn_trigger_threshold": "@trigger_threshold",
        "trigger_distance": 2.0,
        "start_pose": START,
        "goal_pose": GOAL,
        "map_file": "hall.yaml",
    }
    return {"ObstacleVariationWithDistanceTrigger": {**parameters, **trigger, **changes}}


def places(variant) -> list[tuple[float, float]]:
    return [read_pose(one["spawn_pose"]).point for one in variant.parameters["obstacles"]]


def from_path(variant) -> list[float]:
    path = LineString(variant.extra["_navigation"]["path"])
    return [path.distance(Point(place)) for place in places(variant)]


def refusal(expanded, *variations) -> str:
    with pytest.raises(InputError) as caught:
        expanded(*variations)
    return str(caught.value)


def test_an_obstacle_is_what_the_scenario_spawns(expanded) -> None:
    variant = expanded(PATH, obstacles({"amount": 2, "max_distance": 1.0})).variants[0]
    first, second = variant.parameters["obstacles"]
    assert set(first) == {"entity_name", "model", "spawn_pose", "xacro_arguments"}
    assert (first["model"], first["xacro_arguments"]) == (BOX["model"], BOX["xacro_arguments"])
    assert first["entity_name"] != second["entity_name"]


def test_obstacles_are_near_the_path_and_leave_a_way(expanded, folder: Path) -> None:
    composition = expanded(PATH, obstacles({"amount": 4, "max_distance": 1.5}, count=5, seed=3))
    costmap = Costmap(read_map(folder / "hall.yaml"), 0.35)
    radius = radius_of(BOX["xacro_arguments"])
    for variant in composition.variants:
        spots = places(variant)
        assert max(from_path(variant)) <= 1.5
        assert all(costmap.clearance_at(spot) >= radius for spot in spots)
        apart = [math.dist(a, b) for a, b in itertools.combinations(spots, 2)]
        assert min(apart) >= 2 * radius - 1e-3
        left = costmap.without([(spot, radius) for spot in spots])
        assert left.shortest_path((1.0, 3.0), (9.0, 3.0))


def test_lists_multiply_and_count_repeats(expanded) -> None:
    kind = {"amount_per_m": [0.25, 0.5], "max_distance": [0.5, 2.0]}
    composition = expanded(PATH, obstacles(kind, count=2))
    amounts = [len(variant.parameters["obstacles"]) for variant in composition.variants]
    assert amounts == [2, 2, 2, 2, 4, 4, 4, 4]  # of a path of 8 m
    assert len({str(variant.parameters) for variant in composition.variants}) == 8
    nearest = [max(from_path(variant)) for variant in composition.variants]
    assert max(nearest[0], nearest[1], nearest[4], nearest[5]) <= 0.5


def test_amounts_are_cut_numbers_begin_at_zero_and_there_may_be_no_kind(expanded) -> None:
    cut = expanded(PATH, obstacles({"amount_per_m": 0.2}, {"amount": 1})).variants[0]
    names = [one["entity_name"] for one in cut.parameters["obstacles"]]
    assert names == ["obstacle_0", "obstacle_1"]  # 1.6 of the first kind
    assert expanded(PATH, obstacles()).variants[0].parameters["obstacles"] == []


def test_an_obstacle_triggers_where_it_is_and_goals_may_be_a_list(expanded) -> None:
    parameters = triggered({"amount": 1, "max_distance": 1.0})
    settings = parameters["ObstacleVariationWithDistanceTrigger"]
    settings["goal_poses"] = [settings.pop("goal_pose"), START]
    settings |= {
        "spawn_trigger_point": "trigger_point",
        "spawn_trigger_threshold": "trigger_threshold",
    }
    variant = expanded(parameters).variants[0]
    place = variant.parameters["obstacles"][0]["spawn_pose"]["position"]
    assert variant.parameters["trigger_point"] == {**place, "z": 0.0}
    assert variant.parameters["trigger_threshold"] == 2.0


def test_amounts_distances_and_counts_are_counted_out_in_this_order(expanded) -> None:
    short = {**PATH["PathVariationRandom"], "goal_poses": [{"x": 3.8, "y": 3.0}]}
    path = {"PathVariationRandom": {**short, "path_length": 2.8}}
    kind = {"amount_per_m": [0, 0.5], "max_distance": [0.2, 0.4]}
    variants = expanded(path, obstacles(kind, count=2)).variants
    assert [len(v.parameters["obstacles"]) for v in variants] == [0, 0, 0, 0, 1, 1, 1, 1]
    trigger = triggered(
        {"amount": 1, "max_distance": [0.0, 1.5]}, trigger_distance=[1.0, 3.0], count=2
    )
    variants = expanded(trigger).variants
    assert [v.parameters["trigger_threshold"] for v in variants] == [1.0] * 4 + [3.0] * 4
    on_path = [round(places(v)[0][1], 3) == 3.0 for v in variants]
    assert on_path == [True, True, False, False] * 2


@pytest.mark.parametrize("kind", ["ObstacleVariation", "ObstacleVariationWithDistanceTrigger"])
def test_a_parameter_that_is_not_known_is_refused(expanded, kind: str) -> None:
    call = obstacles() if kind == "ObstacleVariation" else triggered()
    call[kind]["colour"] = "red"
    assert "unknown key `colour`" in refusal(expanded, PATH, call)


def test_equal_seeds_give_equal_obstacles(expanded) -> None:
    kind = {"amount": 2, "max_distance": 1.0}
    first, again, other = (
        expanded(PATH, obstacles(kind, seed=seed)).variants[0].parameters for seed in (1, 1, 2)
    )
    assert first == again
    assert first != other


def test_without_a_path_obstacles_are_anywhere(expanded) -> None:
    variant = expanded(obstacles({"amount": 3}, map_file="hall.yaml")).variants[0]
    assert len(places(variant)) == 3
    text = refusal(expanded, obstacles({"amount": 3, "max_distance": 1.0}, map_file="hall.yaml"))
    assert text.startswith("configuration `hall`: ObstacleVariation: ")
    assert "put a path variation before" in text
    assert "there is no map" in refusal(expanded, obstacles({"amount": 1}))


def test_no_obstacles_are_a_list_too(expanded) -> None:
    variant = expanded(PATH, obstacles({"amount": 0})).variants[0]
    assert variant.parameters["obstacles"] == []


def test_more_obstacles_than_fit(expanded) -> None:
    text = refusal(expanded, PATH, obstacles({"amount": 500, "max_distance": 0.5}))
    assert text.startswith("configuration `hall-1`: ObstacleVariation: only ")
    assert "of 500 obstacles fit near the path" in text
    wide = {"amount": 1, "max_distance": 0.1, "xacro_arguments": "radius:=1.9"}
    assert "of 1 obstacles fit" in refusal(expanded, PATH, obstacles(wide))


def test_obstacles_that_close_every_way(expanded) -> None:
    path = {
        **PATH["PathVariationRandom"],
        "start_pose": {"x": 4.6, "y": 3.0},
        "goal_poses": [{"x": 5.4, "y": 3.0}],
        "path_length": 0.8,
    }
    plug = {"amount": 1, "max_distance": 0.0, "xacro_arguments": "radius:=0.1"}  # in the door
    text = refusal(expanded, {"PathVariationRandom": path}, obstacles(plug))
    assert "1 obstacle fits, but blocks the way to a goal" in text


def test_a_trigger_is_on_the_path_beside_the_obstacle(expanded) -> None:
    composition = expanded(
        triggered({"amount": 1, "max_distance": 0.5}, trigger_distance=[1.0, 3.0], count=3)
    )
    thresholds = [variant.parameters["trigger_threshold"] for variant in composition.variants]
    assert thresholds == [1.0] * 3 + [3.0] * 3
    for variant in composition.variants:
        point = variant.parameters["trigger_point"]
        assert set(point) == {"x", "y", "z"}
        assert math.dist((point["x"], point["y"]), places(variant)[0]) <= 0.5 + 1e-3
        reached = math.dist((point["x"], point["y"]), (START["x"], START["y"]))
        assert reached >= variant.parameters["trigger_threshold"] - 0.5 - 1e-3


def test_a_trigger_needs_a_path(expanded) -> None:
    alone = triggered({"amount": 1}, start_pose="@start_pose")
    assert "there is no path: give `start_pose` and `goal_pose`" in refusal(expanded, alone)
    after = expanded(PATH, triggered({"amount": 1}, start_pose=None, goal_pose=None))
    assert after.variants[0].parameters["trigger_threshold"] == 2.0
    far = triggered({"amount": 1, "max_distance": 1.0}, trigger_distance=20.0)
    assert "its first 20 m must have no obstacle" in refusal(expanded, far)
    inside = triggered({"amount": 1}, start_pose={"x": 5.0, "y": 0.5})
    assert "the start (5, 0.5) is inside a wall" in refusal(expanded, inside)


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ({"amount": -1}, "must be at least 0"),
        ({"amount": 1, "amount_per_m": 1.0}, "set either `amount` or"),
        ({}, "set either `amount` or"),
        ({"amount": 1, "max_distance": -2.0}, "max_distance"),
        ({"amount": 1, "xacro_arguments": "width:=-0.5"}, "`width` of an obstacle must be"),
        ({"amount": 1, "xacro_arguments": "radius:=0"}, "`radius` of an obstacle must be"),
        ({"amount": 1, "xacro_arguments": "length:=1.2.3"}, "not 1.2.3"),
    ],
)
def test_wrong_parameters(expanded, kind, reason: str) -> None:
    assert reason in refusal(expanded, PATH, obstacles(kind))


@pytest.mark.parametrize(
    ("arguments", "radius"),
    [
        ("width:=0.6, length:=0.8, height:=2.0", 0.5),
        ("radius:=0.3 height:=1", 0.3),
        ("width := 0.2", math.hypot(0.2, 0.2) / 2),
        ("", 0.25),
    ],
)
def test_the_size_follows_from_the_arguments(arguments: str, radius: float) -> None:
    assert radius_of(arguments) == pytest.approx(radius)
