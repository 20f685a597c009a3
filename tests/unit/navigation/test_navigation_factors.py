"""What a person varied of plans, paths and obstacles, beside the parameters that came of it."""

from __future__ import annotations

from pathlib import Path

from robovast.model.document import load_document
from robovast.model.expansion import expand

EXAMPLES = Path(__file__).parents[3] / "configs" / "examples"
FIXED = {"start_pose": {"x": 1.0, "y": 3.0}, "map_file": "hall.yaml"}


def test_the_factors_of_the_robot_are_those_of_its_document(tmp_path: Path) -> None:
    document = load_document(EXAMPLES / "robot_navigation" / "robot_navigation.vast")
    variants = expand(document, tmp_path)
    different = {
        name: {variant.factors[name]["value"] for variant in variants}
        for name in variants[0].factors
    }
    assert different == {
        "floor_plan": {"depot", "flat"},
        "path_length": {5.0},
        "goals": {1},
        "path": {"1", "2"},
        "clutter": {0.25, 1.0},
        "obstacle_distance": {0.8},
        "placement": {"1"},
        "margin": {0.02, 0.1},
    }
    assert variants[0].factors["clutter"]["unit"] == "1/m"


def test_kinds_of_obstacles_and_triggers_have_factors_of_their_own(expanded) -> None:
    kinds = [{"amount": 1, "model": "box.sdf.xacro"}, {"amount": 2, "model": "models/pole.sdf"}]
    trigger = {
        "ObstacleVariationWithDistanceTrigger": {
            "name": "obstacles",
            "obstacle_configs": kinds,
            "spawn_trigger_point": "@trigger_point",
            "spawn_trigger_threshold": "@trigger_threshold",
            "trigger_distance": [1.0, 2.0],
            "goal_pose": {"x": 9.0, "y": 3.0},
            **FIXED,
        }
    }
    found = [variant.factors for variant in expanded(trigger).variants]
    assert [one["trigger_distance"] for one in found] == [
        {"value": 1.0, "unit": "m"},
        {"value": 2.0, "unit": "m"},
    ]
    assert list(found[0])[:2] == ["number_of_obstacles_box", "number_of_obstacles_pole"]


def test_drawn_plans_are_told_from_their_model(tmp_path: Path) -> None:
    folder = EXAMPLES / "floor_plans"
    document = load_document(next(folder.glob("*.vast")))
    found = [variant.factors for variant in expand(document, tmp_path)]
    assert all("floor_plan" in one for one in found)
