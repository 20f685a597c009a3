"""Everything that plugins and notebooks import is there."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import pytest

import robovast.common
from robovast.base import file_cache
from robovast.base.errors import InputError
from robovast.common import config, execution, progress

NAMES = [
    "VariationConfig",
    "get_validated_config",
    "filter_configs",
    "get_scenario_parameters",
    "is_scenario_parameter",
    "load_config",
    "get_campaign",
    "get_campaign_timestamp",
    "is_campaign_dir",
    "normalize_secondary_containers",
    "COMPAT_VERSION",
    "FileCache",
    "convert_dataclasses_to_dict",
    "ProgressBar",
    "fmt_size",
    "generate_scenario_variations",
]


@pytest.mark.parametrize("name", NAMES)
def test_name_is_exported(name: str) -> None:
    assert getattr(robovast.common, name) is not None
    assert name in robovast.common.__all__


def test_another_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = robovast.common.nothing


def test_importing_the_version_loads_nothing_heavy() -> None:
    code = (
        "import sys; from robovast.common.execution import COMPAT_VERSION;"
        "print(COMPAT_VERSION, [m for m in ('pydantic', 'rdflib', 'yaml', 'pandas')"
        " if m in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "2 []"


def test_campaign_folder_names() -> None:
    when = datetime(2026, 3, 10, 14, 25, 30)
    name = execution.campaign_folder_name("navigation_evaluation", when)
    assert name == "navigation-evaluation-2026-03-10-142530"
    assert execution.is_campaign_dir(f"/results/{name}")
    assert not execution.is_campaign_dir("/results/navigation")
    assert execution.get_campaign_timestamp(name) == "2026-03-10-142530"
    assert execution.is_campaign_dir(execution.get_campaign("hall"))
    of_a_script = "navigation_evaluation-2026-03-10-14253042"
    assert execution.is_campaign_dir(of_a_script)
    assert execution.get_campaign_timestamp(of_a_script) == "2026-03-10-14253042"
    assert execution.campaign_time(of_a_script) == execution.campaign_time(name) == when
    assert execution.campaign_time("navigation-2026-13-10-142530") is None
    assert execution.campaign_prefix("../../etc") == "etc"
    assert execution.campaign_prefix("a_b c", "._-") == "a_b-c"
    assert execution.campaign_prefix("a b/c") == "a-b-c"
    assert execution.campaign_prefix("x" * 199 + "-" + "y" * 100) == "x" * 199


@pytest.mark.parametrize(
    ("value", "name"),
    [("$x", "x"), ("${path_length}", "path_length"), ("a $x", None), ("$$x", None), (3, None)],
)
def test_markers(value: object, name: str | None) -> None:
    assert config.match_var_marker(value) == name


def test_secondary_containers_are_normalized() -> None:
    given = ["nav", {"sim": {"resources": {"cpu": 2}}}, {"plain": None}]
    given.append({"rviz": None, "resources": {"cpu": 3}})
    assert config.normalize_secondary_containers(given) == [
        {"name": "nav", "resources": {}},
        {"name": "sim", "resources": {"cpu": 2}},
        {"name": "plain", "resources": {}},
        {"name": "rviz", "resources": {"cpu": 3}},
    ]


def test_keys_that_are_not_for_people_are_dropped() -> None:
    configs = [{"name": "hall-1", "config": {"x": 1}, "_config_files": []}]
    assert config.filter_configs(configs) == [{"name": "hall-1", "config": {"x": 1}}]


def test_load_config_reads_a_section(tmp_path: Path) -> None:
    path = tmp_path / "a.vast"
    path.write_text("version: 1\nexecution: {runs: 3}\n")
    assert config.load_config(path)["version"] == 1
    assert config.load_config(path, "execution") == {"runs": 3}
    assert config.load_config(path, "search", allow_missing=True) == {}
    with pytest.raises(InputError, match=r"no section `search`\. Use one of version, execution"):
        config.load_config(path, "search")


@dataclass
class Inner:
    x: int


@dataclass
class Outer:
    items: list[Inner]


def test_dataclasses_become_dicts() -> None:
    assert robovast.common.convert_dataclasses_to_dict({"a": (Outer([Inner(1)]), 2)}) == {
        "a": [{"items": [{"x": 1}]}, 2]
    }


def test_parameters_of_a_scenario_by_type(tmp_path: Path) -> None:
    path = tmp_path / "a.osc"
    path.write_text(
        "scenario a:\n    x: float = 1.0\n    goals: list of pose_3d\n    do serial:\n"
        "        log(x)\n"
    )
    assert robovast.common.get_scenario_parameters(path) == {
        "a": [
            {"name": "x", "type": "float", "is_list": False},
            {"name": "goals", "type": "pose_3d", "is_list": True},
        ]
    }


@pytest.mark.parametrize(
    ("size", "text"), [(0, "0 B"), (1023, "1023 B"), (1536, "1.5 KiB"), (3 * 2**40, "3.0 TiB")]
)
def test_sizes(size: int, text: str) -> None:
    assert progress.fmt_size(size) == text


def test_a_progress_line() -> None:
    line = progress.ProgressBar(200, "upload", width=10).line(100)
    assert re.fullmatch(r"upload  ━{5} *  100 B/200 B", line)


def test_the_file_cache_keeps_by_content(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("1")
    (tmp_path / "b").write_text("1")
    cache = file_cache.ContentCache(tmp_path / "cache", "maps")
    key = cache.key([tmp_path / "a"], "v1")
    assert key == cache.key([tmp_path / "b"], "v1") != cache.key([tmp_path / "b"], "v2")
    assert cache.get(key) is None
    cache.put(key, tmp_path / "a")
    kept = cache.get(key)
    assert kept is not None
    assert kept.read_text() == "1"


def test_files_are_kept_beside_the_data_of_a_plugin(tmp_path: Path) -> None:
    made_of = tmp_path / "model"
    made_of.write_text("1")
    cache = file_cache.FileCache(tmp_path, "map_", ["v1"], ".txt")
    assert cache.get_cached_file([made_of]) is None
    path = cache.save_file_to_cache([made_of], "made")
    assert path.name.startswith("map_")
    assert path.suffix == ".txt"
    assert cache.get_cached_file([made_of]) == "made"
    assert cache.get_cached_file([made_of], binary=True) == b"made"
    assert cache.get_cached_file([made_of], content=False) == path
    assert cache.get_cached_file([made_of], strings_for_hash=["other"]) is None
    other = file_cache.FileCache(tmp_path, "map_", ["v2"], ".txt")
    assert other.get_cached_file([made_of]) is None
    made_of.write_text("2")
    assert cache.get_cached_file([made_of]) is None


def test_an_expansion_in_plain_values(tmp_path: Path) -> None:
    (tmp_path / "a.osc").write_text("scenario a:\n    x: int = 1\n    do serial:\n        log(x)\n")
    (tmp_path / "a.vast").write_text(
        "version: 1\nconfiguration:\n- name: t\n  variations:\n"
        "  - ParameterVariationList: {name: x, values: [1, 2]}\n"
        "execution: {scenario_file: a.osc}\n"
    )
    campaign, gui = robovast.common.generate_scenario_variations(tmp_path / "a.vast")
    assert [item["config"] for item in campaign["configs"]] == [{"x": 1}, {"x": 2}]
    assert gui == {}
    with pytest.raises(ValueError, match="by the names in the"):
        robovast.common.generate_scenario_variations(tmp_path / "a.vast", variation_classes={})
