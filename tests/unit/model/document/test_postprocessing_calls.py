"""Postprocessing commands are checked when a document is read: once, and before any run."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import DocumentError
from robovast.model.document import load_document
from robovast.model.document.loader import Document


def load(folder: Path, commands: str, section: str = "results_processing") -> Document:
    (folder / "a.osc").write_text("scenario drive:\n    do serial:\n        wait elapsed(1s)\n")
    path = folder / "a.vast"
    path.write_text(
        "version: 1\nexecution: {scenario_file: a.osc}\n"
        f"{section}:\n  postprocessing:\n{commands}"
    )
    return load_document(path)


@pytest.mark.parametrize(
    ("command", "problem"),
    [
        ("rosbags_tf_to_csv: {frame: [a]}", "unknown key `frame`\n    Did you mean `frames`?"),
        ("rosbags_tf_to_csv: {frames: base_link}", "frames: must be a list, not 'base_link'"),
        ("rosbags_action_to_csv", "the key `action` is missing"),
        ("rosbags_rosout_to_csv: {min_level: LOUD}", "min_level: must be one of DEBUG, INFO, WARN"),
        ("rosbags_to_webm: {fps: 0}", "fps: must be greater than 0, not 0"),
        ("rosbags_process: {plugins: [{type: to_cvs}]}", "type: must be one of to_csv, tf_to_csv"),
        ("command: {args: [a]}", "the key `script` is missing"),
    ],
)
@pytest.mark.parametrize("section", ["results_processing", "analysis"])
def test_what_cannot_be_called_is_an_error_with_its_place(
    tmp_path: Path, command: str, problem: str, section: str
) -> None:
    with pytest.raises(DocumentError) as error:
        load(tmp_path, f"  - {command}\n", section)
    (found,) = error.value.problems
    assert problem in str(found)
    assert f"a.vast:5:{found.place.column}: {section}.postprocessing[0]" in str(found)


@pytest.mark.parametrize(
    ("command", "warning"),
    [
        ("rosbags_to_csv", "`rosbags_to_csv` without `topics` does nothing"),
        ("rosbags_process: {workers: 2}", "workers: `workers` has no effect: runs are always"),
        ("rosbags_bt_to_csv: {colour: red}", "does not know the parameter `colour`; it has no eff"),
        ("their_own_metrics: {a: 1}", "no plugin `their_own_metrics` is installed here"),
        ("rosbags_tf_to_cvs", "is installed here\n    Did you mean `rosbags_tf_to_csv`?"),
        ("tools/none.py:Metrics", "there is no file tools/none.py in"),
    ],
)
def test_what_need_not_be_here_before_there_are_results_is_a_warning(
    tmp_path: Path, command: str, warning: str
) -> None:
    (told,) = map(str, load(tmp_path, f"  - {command}\n").warnings)
    assert warning in told


@pytest.mark.parametrize(
    ("lists", "warnings"),
    [
        ("publication: [zip, zenodo: {sandbox: true}]", []),
        ("publication: [zipp]", ["no plugin `zipp` is installed here\n    Did you mean `zip`?"]),
        ("metadata_processing: [theirs]", ["no plugin `theirs` is installed here"]),
        ("metadata_processing: ['none.py:Own']", ["there is no file none.py in"]),
    ],
)
def test_other_plugins_for_results_are_looked_for_too(
    tmp_path: Path, lists: str, warnings: list[str]
) -> None:
    told = load(tmp_path, f"  - rosbags_bt_to_csv\n  {lists}\n").warnings
    assert len(told) == len(warnings)
    assert all(part in str(warning) for part, warning in zip(warnings, told, strict=True))


def test_what_is_right_is_not_spoken_of(tmp_path: Path) -> None:
    (tmp_path / "m.py").write_text("raise SystemExit  # it is not executed\n")
    commands = """\
  - rosbags_to_csv: {topics: [/odom]}
  - rosbags_tf_to_csv
  - rosbags_rosout_to_csv: {min_level: error, bag_dir: logs/rosout_bag}
  - rosbags_process: {plugins: [{type: tf_to_csv, frames: [a]}], bag_dir: x/y}
  - command: {script: docker_exec.sh, args: [1, --x]}
  - compress: {overwrite: true}
  - m.py:Metrics: {anything: 1}
"""
    assert load(tmp_path, commands).warnings == ()
