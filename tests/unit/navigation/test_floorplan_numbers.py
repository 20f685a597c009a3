"""Malformed floor plans and variations are refused with the place of the fault."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import InputError
from robovast.navigation.floorplan.language import read_floorplan
from robovast.navigation.floorplan.layout import lay_out
from robovast.navigation.floorplan.render import render
from robovast.navigation.floorplan.sampling import read_variation

PLAN = """Floor plan: flat
    Space hall:
        shape: Rectangle width={} m, length=2.0 m
        location:
            wrt: world
"""


@pytest.mark.parametrize(
    "number", ["9" * 400, "1" * 5000, "1e400", "1e308", "1e10", "-1e999", "-9e9", "/**/1e308"]
)
def test_numbers_that_are_too_large_have_a_place(tmp_path: Path, number: str) -> None:
    plan, variation = tmp_path / "flat.fpm", tmp_path / "flat.variation"
    plan.write_text(PLAN.format(number))
    with pytest.raises(InputError, match=r"flat.fpm:3:3[26].* is too large"):
        read_floorplan(plan)
    plan.write_text(PLAN.format("3.0"))
    for draw in (
        f"uniform([{number}])",
        f"normal(mean={number}, std=1)",
        f"discrete([(1, {number})])",
    ):
        variation.write_text(f'import "flat.fpm"\nhall: {{ shape.width: {draw} }}\n')
        with pytest.raises(InputError, match=r"flat.variation:2:\d+.* is too large"):
            read_variation(variation)


def test_a_plan_of_too_many_cells_is_refused_before_it_is_drawn(tmp_path: Path) -> None:
    plan = tmp_path / "flat.fpm"
    plan.write_text(PLAN.format("900000.0"))
    with pytest.raises(InputError, match=r"more than 64,000,000\. Use a coarser resolution"):
        render(lay_out(read_floorplan(plan)))


@pytest.mark.parametrize("name", ["a\0b", "x" * 300])
def test_names_that_no_file_can_have(tmp_path: Path, name: str) -> None:
    path = tmp_path / "flat.variation"
    path.write_text(f'import "{name}"\n')
    with pytest.raises(InputError):
        read_variation(path)


def test_a_variation_imports_a_model_of_another_folder(tmp_path: Path) -> None:
    (tmp_path / "drawn").mkdir()
    (tmp_path / "flat.fpm").write_text(PLAN.format("3.0"))
    (tmp_path / "drawn/flat.variation").write_text('import "../flat.fpm"\n')
    found = read_variation(tmp_path / "drawn/flat.variation")
    assert found.model.path == tmp_path / "flat.fpm"
