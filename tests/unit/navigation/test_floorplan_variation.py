"""Floor plans in campaigns: files, distributions, errors."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from robovast.base.errors import InputError, RobovastError
from robovast.navigation.occupancy import read_map

ROOM = """\
// creator: Ada Example <https://orcid.org/0000-0002-1825-0097>
// contributor: Bo
// license: CC-BY-4.0
// modified: 2026-01-02
Floor plan: room
    Space hall:
        shape: Rectangle width=6.0 m, length=5.0 m
        location:
            wrt: world
        features:
            Column pillar:
                shape: Rectangle width=0.5 m, length=0.5 m
                height: 2.0 m
                location:
                    wrt: this
    Entryway door:
        shape: Rectangle width=1.0 m, height=2.0 m
        location:
            in: hall.walls[1]
"""

VARIED = """\
import "room.fpm"
hall: {
    shape.width: uniform([5.0, 6.0, 7.0])
    walls.thickness: discrete([(0.5, 0.1), (0.5, 0.3)])
}
hall.pillar: {
    location.transformation.translation.x: normal(mean=0.0, std=0.5)
}
"""

PATH = {
    "PathVariationRandom": {
        "start_pose": "@start_pose",
        "goal_poses": "@goal_poses",
        "path_length": 3.0,
        "seed": 1,
    }
}


@pytest.fixture
def plans(folder: Path) -> Path:
    (folder / "plans").mkdir()
    (folder / "plans/room.fpm").write_text(ROOM)
    (folder / "plans/wide.fpm").write_text(ROOM.replace("width=6.0", "width=9.0"))
    (folder / "plans/room.variation").write_text(VARIED)
    return folder / "plans"


def generation(*files: str) -> dict[str, Any]:
    return {"FloorplanGeneration": {"name": ["map_file", "mesh_file"], "floorplans": [*files]}}


def variation(**changes: Any) -> dict[str, Any]:
    parameters = {
        "name": ["map_file", "mesh_file"],
        "variation_files": ["plans/room.variation"],
        "num_variations": 3,
        "seed": 4,
    }
    return {"FloorplanVariation": {**parameters, **changes}}


def test_each_plan_brings_a_map_and_a_mesh(expanded, plans: Path) -> None:
    composition = expanded(generation("plans/room.fpm", "plans/wide.fpm"), PATH)
    assert [v.name for v in composition.variants] == ["hall-1-1", "hall-2-1"]
    for variant, width in zip(composition.variants, (6.0, 9.0), strict=True):
        files = {file.name: file.source for file in variant.files}
        assert variant.parameters["mesh_file"] in files
        occupancy = read_map(files[variant.parameters["map_file"]])
        assert occupancy.free.sum() * 0.05**2 == pytest.approx(width * 5 + 0.2 - 0.25, abs=0.3)
        assert variant.extra["_navigation"]["path"]
    assert Path("plans/room.fpm") in composition.input_files


def test_variants_of_one_plan_can_share_a_job(expanded, plans: Path) -> None:
    composition = expanded(generation("plans/room.fpm", "plans/wide.fpm"))
    first, second = ({file.name for file in v.files} for v in composition.variants)
    assert not first & second


def test_plans_are_drawn_by_the_distributions(expanded, plans: Path) -> None:
    composition = expanded(variation(num_variations=6))
    texts = [file.source.read_text() for file in composition.transient_files]
    assert len(set(texts)) == 6
    assert {
        line for text in texts for line in text.splitlines() if "width" in line and "5 m" in line
    }
    again = expanded(variation(num_variations=6))
    assert [v.parameters for v in again.variants] == [v.parameters for v in composition.variants]
    other = expanded(variation(num_variations=6, seed=5))
    assert [v.parameters for v in other.variants] != [v.parameters for v in composition.variants]


def test_plans_are_those_of_the_seed(expanded, plans: Path) -> None:
    (plans / "base.fpm").write_text("""\
Floor plan: base
    var door = 0.9 m
    var wt = 0.2 m
    var off = 0.1 m
    Space room:
        shape: Rectangle width=2.0 m, length=off
        location:
            wrt: world
            of: this
            rotation: z: 10.0 deg
        walls:
            thickness: wt
    Entryway exit:
        shape: Rectangle width=door, height=2.0 m
        location:
            in: room.walls[0]
""")
    (plans / "base.variation").write_text("""\
import 'base.fpm'
door : uniform([0.5, 1.0])
wt : normal(mean=0.3, std=0.05)
room: { shape.width: discrete([(0.5, 3.0), (0.5, 4.0)]) shape.length: uniform([7.0]) }
off : discrete([(0.2, 0.5), (0.8, 1.5)])
exit: { location.rotation.y: uniform([0.0]) }
room: { location.rotation.z: uniform([20.0]) }
""")
    composition = expanded(
        {"ParameterVariationList": {"name": "trigger_threshold", "values": [1.0, 2.0]}},
        variation(variation_files=["plans/base.variation"], seed=7),
    )
    maps = [f"maps/base_{seed}.yaml" for seed in (7, 8, 9) for _ in "ab"]
    assert [v.parameters["map_file"] for v in composition.variants] == maps
    assert [v.name for v in composition.variants][:3] == ["hall-1-1", "hall-2-1", "hall-1-2"]
    texts = {file.name: file.source.read_text() for file in composition.transient_files}
    assert list(texts) == [f"fpm/base_{seed}.fpm" for seed in (7, 8, 9)]
    rooms = (text[text.index("Space") :] for text in texts.values())
    sizes = [tuple(re.findall(r"(?:width|length|thickness)[=:] ?([0-9.]+)", r)) for r in rooms]
    assert sizes == [
        ("4", "1.5", "0.26", "1"), ("3", "1.5", "0.36", "1"), ("3", "1.5", "0.3", "0.5"),
    ]  # fmt: skip
    assert all("rotation: z: 0.349066 rad" in text for text in texts.values())


def test_a_plan_that_is_not_sound_is_drawn_again(expanded, plans: Path) -> None:
    text = VARIED.replace("uniform([5.0, 6.0, 7.0])", "uniform([-5.0, 6.0])")
    (plans / "room.variation").write_text(text)
    assert len(expanded(variation(num_variations=5)).variants) == 5
    (plans / "room.variation").write_text(text.replace("-5.0, 6.0", "-5.0"))
    with pytest.raises(InputError, match=r"the width must be above 0 m, not -5 m(.|\n)*Narrow"):
        expanded(variation())


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('"room.fpm"', '"none.fpm"', "there is no such file"),
        (
            "hall: {",
            "hell: {",
            ":2:1: configuration `hall`: FloorplanVariation: the floor plan `room` has no `hell`",
        ),
        ("shape.width", "shape.radius", "`shape.radius` of `hall` cannot be varied"),
        ("(0.5, 0.1)", "(0.7, 0.1)", "the weights must sum to 1, not 1.2"),
        ("std=0.5", "std=-0.5", "`std` must not be below 0"),
        (
            "[5.0, 6.0, 7.0]",
            "[5.0, 6.0 deg]",
            ":3:32: configuration `hall`: FloorplanVariation: a length in m, cm or mm is needed "
            "here, not a value in deg",
        ),
        (
            "normal(",
            "gauss(",
            ":7:44: configuration `hall`: FloorplanVariation: `gauss` does",
        ),
    ],
)
def test_errors_in_variation_files(expanded, plans: Path, old, new, reason: str) -> None:
    (plans / "room.variation").write_text(VARIED.replace(old, new))
    with pytest.raises(RobovastError) as caught:
        expanded(variation())
    assert reason in str(caught.value)


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        (["plans/none.fpm"], "there is no such file"),
        (["plans/bad.fpm"], r"bad.fpm:7:32: configuration `hall`: FloorplanGeneration: the width"),
        (["plans/room.fpm", "plans/../plans/room.fpm"], "have one name"),
    ],
)
def test_wrong_files(expanded, plans: Path, files, reason: str) -> None:
    (plans / "bad.fpm").write_text(ROOM.replace("width=6.0", "width=-6.0"))
    with pytest.raises(InputError, match=reason):
        expanded(generation(*files))


def test_the_examples_of_the_documentation_are_sound(expanded, plans: Path) -> None:
    text = (Path(__file__).parents[3] / "docs/reference/navigation.md").read_text()
    model, varied = re.findall(r"```\n((?:// creator|import)(?:.|\n)*?)```", text)
    (plans / "flat.fpm").write_text(model)
    (plans / "flat.variation").write_text(varied)
    composition = expanded(variation(variation_files=["plans/flat.variation"], num_variations=5))
    assert len(composition.variants) == 5
