"""What files of the FloorPlan DSL may say, one row each, with what becomes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from robovast.base.errors import RobovastError
from robovast.navigation.floorplan.artefacts import make_artefacts
from robovast.navigation.floorplan.language import read_floorplan
from robovast.navigation.floorplan.layout import lay_out
from robovast.navigation.occupancy import read_map

PLAN = """\
Floor plan: base
    Defaults:
        walls:
            thickness: 0.2 m
            height: 2.5 m
    var v = 1.0 m
    Space room:
        shape: Rectangle width=6.0 m, length=5.0 m
        location:
            wrt: world
            of: this
            translation: x: 0.0 m, y: 0.0 m
            rotation: z: 0.0 deg
        features:
            Column pillar:
                shape: Circle radius=0.25 m
                height: 1.0 m
                location:
                    wrt: this
                    translation: x: 0.5 m, y: 0.0 m
    Divider screen:
        shape: Rectangle width=1.0 m, length=0.1 m
        height: 0.5 m
        location:
            wrt: room
            translation: y: 1.0 m
    Entryway door:
        shape: Rectangle width=v, height=2.0 m
        location:
            in: room.walls[0]
            translation: x: 0.0 m, z: 1.0 m
            rotation: y: 0.0 deg
"""


@pytest.fixture
def plan(folder: Path) -> Path:
    (folder / "base.fpm").write_text(PLAN)
    return folder / "base.fpm"


@pytest.mark.parametrize(
    ("entry", "written"),
    [
        ("room: { shape.width : uniform([4.0]) }", "width=4 m, length=5 m"),
        ("room: { shape.length : uniform([4.0]) }", "width=6 m, length=4 m"),
        ("door: { shape.height : uniform([1.5]) }", "width=1 m, height=1.5 m"),
        ("door: { shape.width : uniform([0.5]) }", "width=1 m, height=2 m"),  # it is a variable
        ("v : uniform([0.5])", "width=0.5 m, height=2 m"),
        ("v: { value : uniform([0.5]) }", "width=1 m, height=2 m"),  # no effect
        ("room: { location.translation.x : uniform([3.0]) }", "translation: x: 3 m, y: 0 m"),
        ("room: { location.translation.y : uniform([3.0]) }", "translation: x: 0 m, y: 3 m"),
        ("door: { location.translation.z : uniform([1.2]) }", "z: 1.2 m"),
        ("room: { location.rotation.z : uniform([90.0]) }", "rotation: z: 1.5708 rad"),
        ("door: { location.rotation.y : uniform([90.0]) }", "rotation: y: 1.5708 rad"),
        ("room.pillar: { height : uniform([0.9]) }", "height: 0.9 m"),
        ("room: { defaults.wall.thickness : uniform([0.3]) }", "thickness: 0.3 m"),
        ("room: { defaults.wall.height : uniform([2.0]) }", "height: 2 m"),
        ("// a comment\nv : discrete([(1.0, 0.7)])", "width=0.7 m, height=2 m"),
        ("v : discrete([(0.9999995, 0.7)])", "width=0.7 m, height=2 m"),  # the weights are rounded
        ("v : normal(mean=0.7, std=0.0)", "width=0.7 m, height=2 m"),
        ("room: { shape.width : uniform([4.0]) shape.length : uniform([3.0]) }", "4 m, length=3 m"),
    ],
)
@pytest.mark.parametrize("quote", ["'", '"'])
def test_each_attribute_is_drawn(
    expanded, plan: Path, entry: str, written: str, quote: str
) -> None:
    plan.with_suffix(".variation").write_text(f"import {quote}base.fpm{quote}\n{entry}\n")
    parameters = {"variation_files": ["base.variation"], "num_variations": 1, "seed": 3}
    names = {"name": ["map_file", "mesh_file"]}
    composition = expanded({"FloorplanVariation": names | parameters})
    (drawn,) = (f for f in composition.transient_files if f.name == "fpm/base_3.fpm")
    assert written in drawn.source.read_text()


def test_a_campaign_gets_map_image_and_mesh_by_the_plans_names(expanded, plan: Path) -> None:
    plan.with_name("attic.fpm").write_text(PLAN.replace("plan: base", "plan: attic"))
    given = {"name": ["map_file", "mesh_file"], "floorplans": ["base.fpm", "attic.fpm"]}
    variants = expanded({"FloorplanGeneration": given}).variants
    assert [v.parameters for v in variants] == [
        {"map_file": f"maps/{name}.yaml", "mesh_file": f"3d-mesh/{name}.stl"}
        for name in ("attic", "base")
    ]
    wanted = {"maps/attic.yaml", "maps/attic.pgm", "3d-mesh/attic.stl"}
    assert wanted <= {str(file.name) for file in variants[0].files}


def test_a_plan_fills_two_parameters_at_most(expanded, plan: Path) -> None:
    names = ["map_file", "mesh_file", "third"]
    with pytest.raises(RobovastError, match="name"):
        expanded({"FloorplanGeneration": {"name": names, "floorplans": ["base.fpm"]}})


def pixels(plan: Path) -> tuple[np.ndarray, Path]:
    made = make_artefacts(read_floorplan(plan), "base", plan.parent)
    files = {Path(name).suffix: Path(source) for name, source in made.files}
    return np.asarray(Image.open(files[".pgm"])), files[".yaml"]


def test_the_map_has_cells_of_5_cm_with_a_margin_of_25(plan: Path) -> None:
    image, path = pixels(plan)
    occupancy = read_map(path)
    assert occupancy.resolution == 0.05
    rows, columns = np.nonzero(occupancy.occupied)
    height, width = image.shape
    margins = [rows.min(), height - 1 - rows.max(), columns.min(), width - 1 - columns.max()]
    assert set(margins) <= {25, 26}
    assert np.unique(image).tolist() == [0, 205, 254]


@pytest.mark.parametrize(("z", "free"), [(1.0, True), (0.0, True), (2.0, False)])
def test_an_entryway_is_free_where_a_laser_would_go_through(
    plan: Path, z: float, free: bool
) -> None:
    plan.write_text(PLAN.replace("z: 1.0 m", f"z: {z} m"))
    occupancy = read_map(pixels(plan)[1])
    row, column = (round(value) for value in occupancy.cell((0.0, 2.6)))
    assert bool(occupancy.free[row, column]) is free


def test_an_openings_z_is_its_centre_and_nothing_is_lifted(plan: Path) -> None:
    plan.write_text(PLAN.replace(", z: 1.0 m", ""))
    (door,) = lay_out(read_floorplan(plan)).openings
    assert door.outline.bounds == (-0.5, -1.0, 0.5, 1.0)


def test_a_wall_without_defaults_has_sizes_of_its_own(plan: Path) -> None:
    own = (
        "        walls:\n            thickness: 0.4 m\n            height: 1.0 m\n        features:"
    )
    without = PLAN[: PLAN.index("    Defaults")] + PLAN[PLAN.index("    var v") :]
    plan.write_text(without.replace("        features:", own))
    read = read_floorplan(plan)
    assert (read.thickness(read.spaces[0]), read.height(read.spaces[0])) == (0.4, 1.0)
