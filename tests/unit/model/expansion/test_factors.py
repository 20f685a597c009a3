"""Factors: what a person varied, stated by variation types."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robovast.base.errors import InputError
from robovast.campaign.configurations import configuration_record, variant_of, variants_digest
from robovast.campaign.layout import Layout
from robovast.model.document import load_document
from robovast.model.expansion import Variant, expand
from robovast.model.variations.factors import all_factors, factor_values, note_factors

SCENARIO = """\
scenario a:
    width: float = 1.0
    speed: float = 1.0
    door: string = ""
    mesh: string = ""
"""
PLUGIN = """\
from robovast.common.variation import Factor, Variation

class Door(Variation):
    def variation(self, in_configs):
        return [
            self.update_config(
                config,
                {"door": f"{width}.yaml", "mesh": f"{width}.stl"},
                factors={"door_width": Factor(width, "m")},
            )
            for config in in_configs
            for width in (0.7, 0.9)
        ]

class Old(Variation):
    def variation(self, in_configs):
        return [self.update_config(config, {"mesh": "own.stl"}) for config in in_configs]

class Broken(Variation):
    def variation(self, in_configs):
        return [self.update_config(c, {"door": "x"}, factors={"door": [1]}) for c in in_configs]
"""
DOOR: dict[str, object] = {"plugin.py:Door": {}}
SPEED: dict[str, object] = {"ParameterVariationList": {"name": "speed", "values": [0.4, 0.8]}}


def variants(folder: Path, *variations: object) -> list[Variant]:
    (folder / "plugin.py").write_text(PLUGIN)
    (folder / "a.osc").write_text(SCENARIO)
    entry = f"{{name: a, parameters: [width: 2.0], variations: {list(variations)}}}"
    file = folder / "a.vast"
    text = f"version: 1\nexecution: {{scenario_file: a.osc}}\nconfiguration: [{entry}]\n"
    file.write_text(text)
    return expand(load_document(file), folder)


def test_parameters_that_follow_from_a_factor_are_none(tmp_path: Path) -> None:
    first = variants(tmp_path, DOOR, SPEED)[0]
    assert first.factors == {
        "door_width": {"value": 0.7, "unit": "m"},
        "width": {"value": 2.0},
        "speed": {"value": 0.4},
    }
    assert first.parameters["door"] == "0.7.yaml"
    assert "_factors" not in first.extra


def test_without_a_statement_parameters_are_their_own_factors(tmp_path: Path) -> None:
    found = variants(tmp_path, SPEED, {"plugin.py:Old": {}})
    assert [variant.factors for variant in found] == [{}, {}]
    assert "_factors" not in configuration_record(found[0], timings=True)


def test_a_later_value_is_a_factor_again(tmp_path: Path) -> None:
    first = variants(tmp_path, DOOR, {"plugin.py:Old": {}})[0]
    assert list(first.factors) == ["door_width", "width", "mesh"]


def test_a_second_factor_of_a_name_gets_a_number(tmp_path: Path) -> None:
    first = variants(tmp_path, DOOR, DOOR)[1]
    assert [first.factors[name]["value"] for name in ("door_width", "door_width_2")] == [0.7, 0.9]


def test_a_value_with_structure_is_no_factor(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the factor `door` must be text, a number"):
        variants(tmp_path, {"plugin.py:Broken": {}})


def test_an_alternative_keeps_its_factors(tmp_path: Path) -> None:
    either = {"OneOfVariation": {"variations": [DOOR, SPEED]}}
    found = variants(tmp_path, either)
    assert [list(variant.factors) for variant in found] == [["door_width", "width"]] * 2 + [[], []]


def test_stored_factors_are_read_again_and_change_no_digest(tmp_path: Path) -> None:
    """A campaign that an older version planned goes on with a newer one."""
    first = variants(tmp_path, DOOR)[0]
    record = configuration_record(first, timings=True)
    again = variant_of(Layout(tmp_path), record)
    assert again.factors == first.factors
    del record["_factors"]
    older = variant_of(Layout(tmp_path), record)
    assert older.factors == {}
    assert variants_digest([older]) == variants_digest([first])


def test_a_number_in_a_name_takes_none_of_another() -> None:
    config: dict[str, Any] = {}
    note_factors(config, {}, {"kind": "a"})
    note_factors(config, {}, {"kind": "b", "kind_2": "c"})
    assert [item["value"] for item in config["_factors"].values()] == ["a", "b", "c"]


def test_a_parameter_takes_no_factor_of_its_name() -> None:
    config: dict[str, Any] = {
        "config": {"door": "own.yaml"},
        "_factors": {"door": None, "wall": {"value": "brick"}},
    }
    note_factors(config, {"wall": 3}, None)
    assert factor_values(all_factors(config["_factors"], {"door": "own.yaml", "wall": 3})) == {
        "wall_2": "brick",
        "wall": 3,
    }
