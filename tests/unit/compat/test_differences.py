"""`vast config check` says which differences from the existing tool a file meets."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.compat.differences import differences
from robovast.model.document import load_document

SCENARIO = 'scenario drive:\n    speed: float = 1.0\n    label: string = "a"\n'

OBSTACLES = "obstacle_configs: [{amount: 1, max_distance: 1, model: m}]"


def met(folder: Path, configuration: str, execution: str = "", name: str = "drive") -> list[str]:
    (folder / "drive.osc").write_text(SCENARIO)
    path = folder / "a.vast"
    path.write_text(
        f"version: 1\nmetadata: {{name: {name}}}\n{configuration}"
        f"execution:\n  scenario_file: drive.osc\n{execution}"
    )
    return [str(difference) for difference in differences(load_document(path))]


def variation(text: str) -> str:
    return f"configuration:\n- name: a\n  variations:\n  - {text}\n"


def test_a_file_that_means_the_same_meets_none(tmp_path: Path) -> None:
    same = variation("ParameterVariationList: {name: speed, values: [1, 2]}")
    assert met(tmp_path, same) == []


UNLIKE = ("'1.10'", "007", "12:30", "1e5", "no", "~", "2024-01-01", "1.5")
"""Texts that YAML, or ParameterVariationList, reads as other values than text."""


@given(
    values=st.lists(st.sampled_from(UNLIKE), unique=True, min_size=1),
    same=st.lists(st.sampled_from(("a", "'no'", "b c")), unique=True),
)
def test_all_values_that_stay_text_are_counted(tmp_path_factory, values, same) -> None:
    text = f"ParameterVariationList: {{name: label, values: [{', '.join([*same, *values])}]}}"
    (found,) = met(tmp_path_factory.mktemp("project"), variation(text))
    first, more = values[0].strip("'"), len(values) - 1
    assert f"label: '{first}' {'and' if more else 'stays text'}" in found
    assert (f"and {more} more value" in found) == (more > 0)


@pytest.mark.parametrize("text", ["007", "12:30", "no"])
def test_parameters_that_stay_text_are_named(tmp_path: Path, text: str) -> None:
    same = "- name: a\n  parameters:\n  - {label: '7'}\n  - {speed: 7.0}\n"
    (found,) = met(tmp_path, f"configuration:\n{same}- name: b\n  parameters: [label: {text}]\n")
    assert f"label: '{text}' stays text" in found


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("ParameterVariationList: {name: label, values: ['007', a]}", 6, "'007' stays text"),
        (
            "ParameterVariationDistributionUniform: "
            "{name: speed, num_variations: 2, min: 0, max: 1}",
            6,
            "the seed is derived from the configuration's name",
        ),
        (
            "OneOfVariation: {variations: [{ParameterVariationList: {name: speed, values: [1]}}]}",
            6,
            "numbers the configurations of all alternatives",
        ),
    ],
)
def test_a_variation_that_differs_is_named_with_its_place(
    tmp_path: Path, text: str, line: int, words: str
) -> None:
    (found,) = met(tmp_path, variation(text))
    assert f"a.vast:{line}:" in found
    assert words in found


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "PathVariationRasterized: {start_pose: start, path_length: 5, raster_size: 1}",
            "a name always fails",
        ),
        (
            "PathVariationRandom: {start_pose: '@s', path_length: 5, "
            "goal_poses: [{position: {x: 1, y: 1}}]}",
            "explicit poses are used",
        ),
        (
            "FloorplanVariation: {name: [map], num_variations: 1, variation_files: [a.variation]}",
            "`name` has one item",
        ),
        (
            f"ObstacleVariation: {{name: '@things', {OBSTACLES}}}",
            "the `@` of `name` is dropped",
        ),
        (
            "ObstacleVariationWithDistanceTrigger: {name: o, spawn_trigger_point: '@p', "
            f"spawn_trigger_threshold: t, trigger_distance: 1, {OBSTACLES}}}",
            "the `@` of `spawn_trigger_point` is dropped",
        ),
    ],
)
def test_forms_of_navigation_types_are_named(tmp_path: Path, text: str, words: str) -> None:
    assert any(words in found for found in met(tmp_path, variation(text)))


def test_words_of_floor_plans_are_named_in_their_file(tmp_path: Path) -> None:
    (tmp_path / "a.variation").write_text('import "plan.fpm"\n')
    (tmp_path / "plan.fpm").write_text("Default values:\n  thickness: 23 cm // 5 mm\n")
    text = "FloorplanVariation: {name: [m, n], num_variations: 1, variation_files: [a.variation]}"
    found = [item for item in met(tmp_path, variation(text)) if "plan.fpm" in item]
    assert [item.rpartition("plan.fpm:")[2] for item in found] == [
        "1:1: `Default values:` is valid; in RoboVAST 1.x, it is an error",
        "2:15: lengths in cm and mm are valid; in RoboVAST 1.x, they are errors",
    ]


def test_parameters_of_postprocessing_are_named(tmp_path: Path) -> None:
    commands = """\
analysis:
  postprocessing:
  - rosbags_process: {workers: 3, plugins: [{type: rosout_to_csv, min_level: 40}]}
results_processing:
  postprocessing:
  - rosbags_rosout_to_csv: {skip_levels: [DEBUG]}
"""
    same = variation("ParameterVariationList: {name: speed, values: [1, 2]}")
    found = met(tmp_path, same, commands)
    words = ["`workers` has no effect", "`min_level` counts", "`skip_levels` excludes"]
    assert [word in item for word, item in zip(words, found, strict=True)] == [True] * 3


def test_differences_of_the_document_are_named(tmp_path: Path) -> None:
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "x").write_text("")
    found = met(tmp_path, "", "  run_files: [files/**]\n  timeout: 60\n", "my_drive")
    assert [item.partition(": ")[2] for item in found] == [
        "one configuration, `config1`, runs; RoboVAST 1.x runs nothing",
        "metadata.name: results go into `my-drive-…`, and `run.sh` keeps `_`",
        "execution.run_files[0]: `files/**` includes all files below; in "
        "RoboVAST 1.x, it includes nothing",
        "execution.timeout: also stops a run on this machine; RoboVAST 1.x stops it "
        "only on a cluster",
    ]


def test_what_has_no_effect_here_alone_is_named(tmp_path: Path) -> None:
    text = "  run_files: [../**]\n  env: [{SCENARIO_FILE: x}]\nresults_processing:\n"
    own = tmp_path / "own"  # `../**` takes all that is beside it
    own.mkdir()
    found = met(own, "configuration: [{name: a}]\n", text + "  postprocessing: [foo]\n---\n")
    assert [item.partition(": ")[2] for item in found] == [
        "a second YAML document causes a warning; RoboVAST 1.x does not warn",
        "execution.run_files[0]: `../**` causes a warning; RoboVAST 1.x does not warn",
        "execution.env[0].SCENARIO_FILE: `SCENARIO_FILE` keeps the value of the container "
        "interface; RoboVAST 1.x sets this value",
        "results_processing.postprocessing[0]: foo: if it is not installed, only this "
        "command fails; in RoboVAST 1.x, all commands fail",
    ]
