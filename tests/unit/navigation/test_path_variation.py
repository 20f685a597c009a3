"""Paths: as long as asked, through free space, the same for the same seed; clear refusals."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest

from robovast.base.errors import InputError
from robovast.navigation.occupancy import OccupancyMap, read_map, write_map
from robovast.navigation.poses import read_pose
from robovast_cli.main import command


def random_paths(**changes):
    parameters = {
        "start_pose": "@start_pose",
        "goal_poses": "@goal_poses",
        "map_file": "hall.yaml",
        "path_length": 5.0,
        "seed": 1,
    }
    return {"PathVariationRandom": {**parameters, **changes}}


def corners(variant) -> list[list[float]]:
    return variant.extra["_navigation"]["path"]


def length(points) -> float:
    return sum(math.dist(a, b) for a, b in itertools.pairwise(points))


def clearance(points, occupancy: OccupancyMap) -> float:
    """Least distance of a polyline from the centres of cells that are not free [m]."""
    rows, columns = np.nonzero(~occupancy.free)
    xs, ys = occupancy.point(rows, columns)
    legs = [np.linspace(a, b, 40) for a, b in itertools.pairwise(points)]
    return min(np.hypot(xs - x, ys - y).min() for x, y in np.concatenate(legs))


def refusal(expanded, **changes) -> str:
    with pytest.raises(InputError) as caught:
        expanded(random_paths(**changes))
    return str(caught.value)


def test_a_path_is_as_long_as_asked_and_clear_of_walls(expanded, folder: Path) -> None:
    variants = expanded(random_paths(path_length=[3.0, 8.0], num_paths=3)).variants
    assert [variant.name for variant in variants] == [f"hall-{n}" for n in range(1, 7)]
    occupancy = read_map(folder / "hall.yaml")
    for variant, wanted in zip(variants, [3.0] * 3 + [8.0] * 3, strict=True):
        assert length(corners(variant)) == pytest.approx(wanted, abs=0.5)
        assert clearance(corners(variant), occupancy) >= 0.35 / 2 - 0.05


def test_the_parameters_are_the_ends_of_the_path(expanded) -> None:
    variant = expanded(random_paths(num_goal_poses=2)).variants[0]
    start, goals = variant.parameters["start_pose"], variant.parameters["goal_poses"]
    assert read_pose(start).point == tuple(corners(variant)[0])
    assert read_pose(goals[-1]).point == tuple(corners(variant)[-1])
    assert len(goals) == 2
    assert set(start["orientation"]) == {"roll", "pitch", "yaw"}


def test_a_reference_to_a_single_pose_gets_the_first(expanded, caplog) -> None:
    variant = expanded(random_paths(goal_poses="@goal_pose")).variants[0]
    assert read_pose(variant.parameters["goal_pose"]).point == tuple(corners(variant)[-1])
    variant = expanded(random_paths(goal_poses="goal_pose", num_goal_poses=2)).variants[0]
    first = variant.extra["_navigation"]["goals"][0]
    assert variant.parameters["goal_pose"] == first
    assert "holds one pose, not 2" in caplog.text


def test_references_need_no_mark(expanded) -> None:
    marked = expanded(random_paths()).variants[0]
    bare = expanded(random_paths(start_pose="start_pose", goal_poses="goal_poses")).variants[0]
    assert bare.parameters == marked.parameters


def test_a_map_may_be_named_by_its_parameter_or_by_the_configuration(expanded) -> None:
    maps = {"ParameterVariationList": {"name": "map_file", "values": ["hall.yaml"]}}
    wanted = corners(expanded(random_paths()).variants[0])
    for map_file in ("map_file", "@map_file", None):
        made = expanded(maps, random_paths(map_file=map_file)).variants[0]
        assert corners(made) == wanted


def test_a_parameter_that_the_scenario_lacks_is_written_and_told(expanded, caplog) -> None:
    variant = expanded(random_paths(start_pose="begin")).variants[0]
    assert "begin" in variant.parameters
    assert "a variation writes `begin`, but the scenario `drive` has no such" in caplog.text


def test_lengths_multiply_inside_of_goals_per_metre(expanded) -> None:
    variants = expanded(
        random_paths(num_goal_poses_per_m=[0.5, 1.0], path_length=[2.0, 3.0], num_paths=2)
    ).variants
    assert [v.name for v in variants] == [f"hall-{n}" for n in range(1, 9)]
    assert [len(v.parameters["goal_poses"]) for v in variants] == [1, 1, 2, 2, 2, 2, 3, 3]


def test_equal_seeds_give_equal_paths_and_more_paths_only_append(expanded) -> None:
    few = expanded(random_paths(num_paths=2)).variants
    many = expanded(random_paths(num_paths=4)).variants
    other = expanded(random_paths(num_paths=2, seed=2)).variants
    assert [v.parameters for v in many[:2]] == [v.parameters for v in few]
    assert len({str(v.parameters) for v in [*many, *other]}) == 6


def test_the_number_of_goals_follows_from_the_length(expanded) -> None:
    variants = expanded(
        random_paths(path_length=[4.0, 8.0], num_goal_poses_per_m=0.5, min_distance=0.5)
    ).variants
    assert [len(variant.parameters["goal_poses"]) for variant in variants] == [2, 4]
    for variant in variants:
        poses = [variant.parameters["start_pose"], *variant.parameters["goal_poses"]]
        points = [read_pose(pose).point for pose in poses]
        pairs = [(a, b) for i, a in enumerate(points) for b in points[:i]]
        assert min(math.dist(a, b) for a, b in pairs) >= 0.5 - 1e-3


def test_given_poses_stay_as_they_are(expanded) -> None:
    start = {"x": 1.0, "y": 3.0, "yaw": 1.5}
    fixed = expanded(random_paths(start_pose=start)).variants[0]
    assert corners(fixed)[0] == [1.0, 3.0]
    assert "start_pose" not in fixed.parameters

    pose = {"position": {"x": 1.0, "y": 3.0}, "orientation": {"yaw": 1.5}}
    earlier = {"ParameterVariationList": {"name": "start_pose", "values": [pose]}}
    variant = expanded(earlier, random_paths()).variants[0]
    assert read_pose(variant.parameters["start_pose"]).yaw == 1.5

    goal = {"x": 8.0, "y": 3.0}
    drawn = expanded(random_paths(goal_poses=[goal])).variants[0]
    assert corners(drawn)[-1] == [8.0, 3.0]
    assert length(corners(drawn)) == pytest.approx(5.0, abs=0.5)
    assert "7.00 m long, not 5 m" in refusal(expanded, start_pose=start, goal_poses=[goal])


def test_the_map_and_its_image_come_into_the_campaign(expanded) -> None:
    assert expanded(random_paths()).input_files == (Path("hall.pgm"), Path("hall.yaml"))


def test_the_map_can_be_a_scenario_parameter(expanded) -> None:
    maps = {"ParameterVariationList": {"name": "map_file", "values": ["/config/hall.yaml"]}}
    assert expanded(maps, random_paths(map_file="@map_file")).variants[0].name == "hall-1-1"
    assert "there is no map" in refusal(expanded, map_file=None)


def test_no_path_names_the_configuration_and_what_is_possible(expanded) -> None:
    text = refusal(expanded, path_length=90.0)
    assert text.startswith("configuration `hall`: PathVariationRandom: hall.yaml: no path of 90 m")
    assert "farthest place is about" in text


def test_a_goal_behind_a_wall_cannot_be_reached(expanded, folder: Path) -> None:
    occupancy = read_map(folder / "hall.yaml")
    free = occupancy.free.copy()
    free[:, 98:102] = False
    write_map(OccupancyMap(free, ~free, 0.05), folder / "hall.yaml")
    text = refusal(expanded, start_pose={"x": 1.0, "y": 3.0}, goal_poses=[{"x": 8.0, "y": 3.0}])
    assert "there is no way from (1, 3) to (8, 3) for a robot of 0.35 m" in text


@pytest.mark.parametrize(
    ("start", "reason"),
    [
        ({"x": 5.0, "y": 1.0}, "the start (5, 1) is inside a wall"),
        ({"x": 50.0, "y": 1.0}, "outside the map (x from 0 to 10 m, y from 0 to 6 m)"),
        ({"x": 0.2, "y": 3.0}, "a robot of 0.35 m needs 0.175 m"),
        ({"x": 1.0}, "is not a valid pose"),
    ],
)
def test_a_start_where_the_robot_cannot_be(expanded, start, reason: str) -> None:
    assert reason in refusal(expanded, start_pose=start)


def test_a_map_without_free_space(expanded, folder: Path) -> None:
    nothing = np.zeros((40, 40), bool)
    write_map(OccupancyMap(nothing, ~nothing, 0.05), folder / "hall.yaml")
    assert "the map has no room for a robot of 0.35 m" in refusal(expanded)


def test_a_robot_wider_than_every_door_stays_in_its_room(expanded) -> None:
    assert "no path of 9 m" in refusal(expanded, path_length=9.0, robot_diameter=0.7)


def test_a_map_with_a_missing_image(expanded, folder: Path) -> None:
    (folder / "hall.pgm").unlink()
    text = refusal(expanded)
    assert text.startswith("configuration `hall`: PathVariationRandom: the map ")
    assert "hall.pgm does not exist" in text


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"robot_diameter": 0}, "robot_diameter: must be greater than 0, not 0"),
        ({"path_length": -1.0}, "path_length"),
        ({"path_length": float("inf")}, "path_length"),
        ({"goal_poses": []}, "goal_poses"),
        ({"num_goal_poses": 1, "num_goal_poses_per_m": 1.0}, "not both"),
        ({"start_pose": "not a name"}, "start_pose"),
    ],
)
def test_wrong_parameters(expanded, changes, reason: str) -> None:
    assert reason in refusal(expanded, **changes)


def test_the_list_command_shows_the_poses(document, capsys) -> None:
    path = document(random_paths(num_paths=2))
    with pytest.raises(SystemExit):
        command().main(["-V", str(path), "config", "list", "-o", "json"])
    records = json.loads(capsys.readouterr().out)
    assert [record["name"] for record in records] == ["hall-1", "hall-2"]
    assert set(records[0]["config"]) == {"start_pose", "goal_poses"}
