"""`vast config check` says which differences from the existing tool a file meets."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.compat.differences import differences
from robovast.model.document import load_document

SCENARIO = 'scenario drive:\n    speed: float = 1.0\n    label: string = "a"\n'


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


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("ParameterVariationList: {name: label, values: ['007', a]}", 6, "'007' stays text"),
        (
            "ParameterVariationDistributionUniform: "
            "{name: speed, num_variations: 2, min: 0, max: 1}",
            6,
            "the seed follows from the configuration's name",
        ),
        (
            "OneOfVariation: {variations: [{ParameterVariationList: {name: speed, values: [1]}}]}",
            6,
            "counts on over all alternatives",
        ),
    ],
)
def test_a_variation_that_differs_is_named_with_its_place(
    tmp_path: Path, text: str, line: int, words: str
) -> None:
    (found,) = met(tmp_path, variation(text))
    assert f"a.vast:{line}:" in found
    assert words in found


def test_differences_of_the_document_are_named(tmp_path: Path) -> None:
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "x").write_text("")
    found = met(tmp_path, "", "  run_files: [files/**]\n", "my_drive")
    assert [item.partition(": ")[2] for item in found] == [
        "one configuration, `config1`, runs; there nothing did",
        "metadata.name: results go into `my-drive-…`, and `run.sh` keeps `_`",
        "execution.run_files[0]: `files/**` takes all that is below; there nothing",
    ]
