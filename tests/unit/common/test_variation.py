"""Variation types: names, values, independence, and plugins as users write them."""

from __future__ import annotations

import copy
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.base.errors import CannotRunError, InputError
from robovast.base.installation import DISTRIBUTION
from robovast.common.variation import (
    OneOfVariation,
    ParameterVariationDistributionGaussian,
    ParameterVariationDistributionUniform,
    ParameterVariationList,
    ProvContribution,
    Variation,
)
from robovast.common.variation.loader import load_variation
from robovast.model.variations import BUILT_IN_TYPES
from robovast.model.variations.legacy_random import LegacyRandom
from robovast.model.variations.loader import GROUP
from robovast.navigation.base import NavigationVariation


class Inherits(ParameterVariationList):
    """As a plugin's class may."""


class InheritsAlternatives(OneOfVariation):
    """As a plugin's class may."""


def test_only_a_type_that_says_so_itself_only_computes() -> None:
    alternatives = {"variations": [{"ParameterVariationList": {"name": "x", "values": [1]}}]}
    assert OneOfVariation.is_pure(alternatives)
    assert ParameterVariationList.is_pure({})
    assert not Variation.is_pure({})
    assert not Inherits.is_pure({})
    assert not InheritsAlternatives.is_pure(alternatives)


def test_what_is_installed_says_of_each_type_whether_it_only_computes() -> None:
    """A type that is added here must not cost a Job, nor be expanded in the operator, by chance."""
    points = entry_points(group=GROUP)
    kinds = {point.load() for point in points if point.dist and point.dist.name == DISTRIBUTION}
    assert {kind for kind in kinds if kind.is_pure({"variations": ["x"]})} == {*BUILT_IN_TYPES}
    assert all(issubclass(kind, NavigationVariation) for kind in kinds - {*BUILT_IN_TYPES})
    assert {kind.__name__ for kind in kinds} == {point.name for point in points}


def test_an_alternative_is_one_type_and_no_more() -> None:
    """Which of two comes first is no question of the order in which somebody wrote them."""
    for wrong in ({}, {"ParameterVariationList": {}, "other.py:Other": {}}):
        with pytest.raises(ValueError, match="variations"):
            apply(OneOfVariation, {"variations": [wrong]})


START = [{"name": "two", "config": {}, "_config_files": []}]


def apply(kind: type[Variation], parameters: Any, configs: Any = None) -> list[dict[str, Any]]:
    variation = kind(".", parameters, {"name": "two"}, None, "scenario.osc", None)
    return variation.variation(copy.deepcopy(configs or START))


def values(configs: list[dict[str, Any]], name: str = "x") -> list[Any]:
    return [config["config"][name] for config in configs]


def test_a_list_makes_one_configuration_per_value_with_one_index_per_variation() -> None:
    first = apply(ParameterVariationList, {"name": "x", "values": [1, 2]})
    second = apply(ParameterVariationList, {"name": "y", "values": ["a"]}, first)
    assert [config["name"] for config in second] == ["two-1-1", "two-2-1"]
    assert [config["config"] for config in second] == [{"x": 1, "y": "a"}, {"x": 2, "y": "a"}]


def test_uniform_values_are_the_same_on_every_machine() -> None:
    parameters = {"name": "x", "num_variations": 3, "min": 1, "max": 10, "type": "int", "seed": 42}
    assert values(apply(ParameterVariationDistributionUniform, parameters)) == [2, 1, 5]
    parameters |= {"type": "float"}
    assert values(apply(ParameterVariationDistributionUniform, parameters)) == pytest.approx(
        [6.754841186120954, 1.2250967970040025, 3.4752638653220735], abs=1e-12
    )


def test_several_parameters_change_together() -> None:
    made = apply(ParameterVariationList, {"name": ["x", "y"], "values": [[1.0, "a"], [2.0, "b"]]})
    assert [config["config"] for config in made] == [{"x": 1.0, "y": "a"}, {"x": 2.0, "y": "b"}]


def test_text_that_reads_as_a_number_is_one_unless_the_scenario_wants_text(tmp_path: Path) -> None:
    given = {"name": "x", "values": ["1.5", "yes", "plain", True, {"a": "1"}]}
    assert values(apply(ParameterVariationList, given)) == [1.5, True, "plain", True, {"a": "1"}]
    scenario = tmp_path / "a.osc"
    scenario.write_text("scenario a:\n    x: string\n    do serial:\n        log(x)\n")
    variation = ParameterVariationList(".", given, {}, None, str(scenario), None)
    assert values(variation.variation(START))[:2] == ["1.5", "yes"]


@pytest.mark.parametrize(
    ("kind", "low", "high", "drawn"),
    [
        ("float", 0, 1, [0.3238, 0.1508, 0.6509]),
        ("double", 1, 0, [0.6762, 0.8492, 0.3491]),
        ("integer", 0.9, 3.9, [2, 1, 3, 0]),
        ("int", 3.9, 0.9, [2, 1, 3, 0]),
        ("bool", 0, 0.5, [True, True, False, True]),
        ("string", 1, 9, ["6", "3", "7"]),
        ("anything", 0, 0.5, ["0.16191638"]),
    ],
)
def test_uniform_values_by_type(kind: str, low: float, high: float, drawn: list[Any]) -> None:
    parameters = {"name": "x", "num_variations": len(drawn), "min": low, "max": high}
    found = values(
        apply(ParameterVariationDistributionUniform, parameters | {"seed": 7, "type": kind})
    )
    if isinstance(drawn[0], float):
        assert found == pytest.approx(drawn, abs=1e-4)
    else:
        assert [v[:10] if kind == "anything" else v for v in found] == drawn
        assert list(map(type, found)) == list(map(type, drawn))


@pytest.mark.parametrize(
    ("settings", "drawn"),
    [
        ({"std": 0.5}, [1.8453, 0.7670, 1.0164]),
        ({"std": 3, "min": 0, "max": 3, "type": "integer"}, [3, 0, 1, 2]),
        ({"std": 3, "type": "bool"}, [True, False, True, True]),
    ],
)
def test_gaussian_values_by_type(settings: dict[str, Any], drawn: list[Any]) -> None:
    parameters = {"name": "x", "num_variations": len(drawn), "mean": 1, "seed": 7, **settings}
    found = values(apply(ParameterVariationDistributionGaussian, parameters))
    assert found == pytest.approx(drawn, abs=1e-4)
    assert list(map(type, found)) == list(map(type, drawn))


@given(st.integers(0, 2**32 - 1))
def test_normal_numbers_are_those_of_numpy(seed: int) -> None:
    theirs, ours = np.random.RandomState(seed), LegacyRandom(seed)
    assert [ours.normal(2, 3) for _ in range(5)] == [theirs.normal(2, 3) for _ in range(5)]


def test_a_parameter_that_is_not_known_has_no_effect_unless_it_is_misspelt() -> None:
    assert values(apply(ParameterVariationList, {"name": "x", "values": [1], "group": 7})) == [1]
    inner = {"ParameterVariationList": {"name": "x", "values": [1]}}
    assert values(apply(OneOfVariation, {"variations": [inner], "colour": "red"})) == [1]


def test_without_a_seed_the_values_follow_from_the_names() -> None:
    parameters = {"name": "x", "num_variations": 4, "mean": 0, "std": 1}
    once = values(apply(ParameterVariationDistributionGaussian, parameters))
    assert once == values(apply(ParameterVariationDistributionGaussian, parameters))
    other = apply(ParameterVariationDistributionGaussian, {**parameters, "name": "y"})
    assert once != values(other, "y")


def test_gaussian_values_stay_between_the_limits() -> None:
    parameters = {"name": "x", "num_variations": 50, "mean": 0, "std": 5, "min": -1, "max": 1}
    drawn = values(apply(ParameterVariationDistributionGaussian, parameters))
    assert min(drawn) == -1
    assert max(drawn) == 1


def test_one_of_adds_its_alternatives() -> None:
    alternatives = [
        {"ParameterVariationList": {"name": "x", "values": [1, 2]}},
        {"ParameterVariationList": {"name": "y", "values": ["a"]}},
    ]
    made = apply(OneOfVariation, {"variations": alternatives})
    assert [config["name"] for config in made] == ["two-1", "two-2", "two-3"]
    assert [config["config"] for config in made] == [{"x": 1}, {"x": 2}, {"y": "a"}]


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        (ParameterVariationList, {"name": "x"}, "the parameter `values` is missing"),
        (ParameterVariationList, {"name": "x", "valus": [1]}, "did you mean `values`"),
        (ParameterVariationList, {"name": "x", "values": []}, "`values`"),
        (
            ParameterVariationDistributionUniform,
            {"name": "x", "num_variations": 1, "min": 0, "max": 1, "sed": 1},
            "did you mean `seed`",
        ),
        (
            ParameterVariationList,
            {"name": ["x", "y"], "values": [1]},
            r"`values\[0\]` must be a list",
        ),
        (
            ParameterVariationDistributionGaussian,
            {"name": "x", "num_variations": 1, "mean": 2, "std": 1, "seed": -1},
            "`seed`",
        ),
    ],
)
def test_wrong_parameters_are_named(kind: type[Variation], parameters: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        apply(kind, parameters)


nested = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=2), inner),
    max_leaves=8,
)


@given(st.dictionaries(st.text(min_size=1, max_size=3), nested, max_size=3), nested)
def test_a_plugin_that_changes_its_copy_changes_nothing_else(config: Any, value: Any) -> None:
    variation = Variation(".", {}, {}, None, "scenario.osc", None)
    parent = {"name": "a", "config": config, "_config_files": [("f", "/f")]}
    before = copy.deepcopy(parent)
    first = variation.update_config(parent, {"new": value})
    second = variation.update_config(parent, {"new": value})
    assert first["config"] == {**config, "new": value}
    spoil(first)
    assert parent == before
    assert second["config"] == {**config, "new": value}
    assert (first["name"], second["name"]) == ("a-1", "a-2")


def spoil(value: Any) -> None:
    for item in value.values() if isinstance(value, dict) else value:
        if isinstance(item, dict | list):
            spoil(item)
    if isinstance(value, dict):
        value["spoilt"] = True
        value["name"] = "a-1"
    else:
        value.append("spoilt")


PLUGIN = """
from pathlib import Path
from typing import Optional
from pydantic import ConfigDict
import yaml
from robovast.common import VariationConfig, get_validated_config
from robovast.common.variation import Variation, ProvContribution

class WindConfig(VariationConfig):
    wind_speed: float
    gusts: Optional[list[float]] = None

class WindFieldVariation(Variation):
    CONFIG_CLASS = WindConfig

    def variation(self, in_configs):
        self.progress_update("making wind")
        result = []
        for config in in_configs:
            result.append(self.update_config(
                config,
                {"wind_strength": self.parameters.wind_speed * 2},
                config_files=[("wind/field.csv", self.output_dir + "/field.csv")],
                other_values={"_wind": {"speed": self.parameters.wind_speed}},
            ))
        return result

    @classmethod
    def collect_config_metadata(cls, config_entry, config_dir: Path, campaign_dir: Path) -> dict:
        data_file = config_dir / "_config" / "my_data.yaml"
        if data_file.exists():
            with open(data_file) as f:
                return {"my_data": yaml.safe_load(f)}
        return {}

    @classmethod
    def collect_prov_metadata(cls, config_entry, campaign_namespace, config_namespace,
                              gen_activity_id, vast_id):
        return ProvContribution(graph_nodes=[{"@id": config_namespace["x"]}],
                                scenario_properties={}, run_used_iris=[])
"""


def test_a_plugin_in_a_file_loads_unchanged(tmp_path: Path) -> None:
    (tmp_path / "variations").mkdir()
    (tmp_path / "variations/wind.py").write_text(PLUGIN)
    kind = load_variation("variations/wind.py:WindFieldVariation", tmp_path)
    told: list[str] = []
    variation = kind(str(tmp_path), {"wind_speed": 2.5}, {}, told.append, "s.osc", "/gen")
    (made,) = variation.variation(copy.deepcopy(START))
    assert made["config"] == {"wind_strength": 5.0}
    assert made["_config_files"] == [("wind/field.csv", "/gen/field.csv")]
    assert made["_wind"] == {"speed": 2.5}
    assert told == ["WindFieldVariation: making wind"]
    assert kind.collect_config_metadata({}, tmp_path, tmp_path) == {}
    assert kind.get_required_container({}) is None


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("ParameterVariationLst", "Did you mean `ParameterVariationList`"),
        ("none.py:A", "there is no plugin file"),
        ("broken.py:A", "cannot be imported: ZeroDivisionError"),
        ("fine.py:Missing", "fine.py has no `Missing`. Use one of VALUE"),
        ("fine.py:VALUE", "is not a variation type"),
    ],
)
def test_what_cannot_be_loaded_says_why(tmp_path: Path, reference: str, message: str) -> None:
    (tmp_path / "broken.py").write_text("1 / 0")
    (tmp_path / "fine.py").write_text("VALUE = 1")
    with pytest.raises(InputError, match=message):
        load_variation(reference, tmp_path)


def test_a_package_that_a_type_lacks_is_named(tmp_path: Path) -> None:
    (tmp_path / "lacking.py").write_text("import nosuchpackage.part")
    with pytest.raises(CannotRunError, match="the package `nosuchpackage` is not installed"):
        load_variation("lacking.py:A", tmp_path)


def test_defaults_of_the_hooks() -> None:
    variation = Variation(".", {"raw": 1}, {}, None, "scenario.osc", None)
    assert variation.parameters == {"raw": 1}
    assert variation.get_input_files() == []
    assert variation.get_campaign_transient_files() == []
    assert variation.get_cache_input_files([]) == []
    assert Variation.collect_prov_metadata({}, None, None, "", "") is None
    assert ProvContribution() == ProvContribution([], {}, [])
