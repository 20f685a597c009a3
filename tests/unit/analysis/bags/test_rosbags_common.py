"""Scripts in containers find these helpers beside them, and import them by this name."""

import array
import json
import subprocess
import sys
from pathlib import Path
from shutil import copy

import pytest
from support.campaigns.bags import typestore

import rosbags_common
from rosbags_common import find_rosbags, gen_msg_values, write_provenance_entry


def test_entries_are_appended(tmp_path: Path) -> None:
    file = tmp_path / "provenance.json"
    write_provenance_entry(file, "a/0/x.csv", ["a/0/rosbag2"], "my_plugin", {"n": 1})
    write_provenance_entry(str(file), "a/1/x.csv", ["a/1/rosbag2"], "my_plugin")
    assert json.loads(file.read_text()) == {
        "entries": [
            {
                "output": f"a/{run}/x.csv",
                "sources": [f"a/{run}/rosbag2"],
                "plugin": "my_plugin",
                "params": params,
            }
            for run, params in enumerate([{"n": 1}, {}])
        ]
    }


@pytest.mark.parametrize("nothing", [None, ""])
def test_without_a_file_nothing_is_written(nothing: str | None) -> None:
    write_provenance_entry(nothing, "x", ["y"], "p")


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "notes.json"
    file.write_text('["mine"]')
    with pytest.raises(ValueError, match="is not a provenance file"):
        write_provenance_entry(file, "x", ["y"], "p")
    assert file.read_text() == '["mine"]'


def test_bags_are_found_at_any_depth_but_not_behind_links(tmp_path: Path) -> None:
    for path in ("a/0/rosbag2", "a/1/deep/rosbag2", "a/2/other", "b/rosbag2/rosbag2"):
        (tmp_path / path).mkdir(parents=True)
    (tmp_path / "a/0/job").symlink_to(tmp_path / "b")
    found = [str(Path(path).relative_to(tmp_path)) for path in find_rosbags(tmp_path)]
    assert found == ["a/0/rosbag2", "a/1/deep/rosbag2", "b/rosbag2"]
    assert find_rosbags(str(tmp_path / "a/2"), "other") == [str(tmp_path / "a/2/other")]
    assert find_rosbags(tmp_path / "a/0/rosbag2") == [str(tmp_path / "a/0/rosbag2")]


def test_bags_are_found_by_patterns_and_with_the_date_of_the_recorder(tmp_path: Path) -> None:
    names = ("rosbag2", "rosbag2_2026_11_25-12_00_07", "rosbag2_front", "rosbag2_2026")
    for name in names:
        (tmp_path / name).mkdir()
    found = {
        pattern: [Path(path).name for path in find_rosbags(tmp_path, pattern)]
        for pattern in ("rosbag2", "rosbag2_*", "rosbag2_f*t", "*_2026")
    }
    assert found == {
        "rosbag2": ["rosbag2", "rosbag2_2026_11_25-12_00_07"],
        "rosbag2_*": ["rosbag2_2026", "rosbag2_2026_11_25-12_00_07", "rosbag2_front"],
        "rosbag2_f*t": ["rosbag2_front"],
        "*_2026": ["rosbag2_2026"],
    }


class Point:
    """As rclpy makes them."""

    def __init__(self, x: float) -> None:
        self.x = x

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        return {"x": "double"}


class Path2:
    """As rclpy makes them."""

    points = (Point(1.0), Point(2.0))
    steps = array.array("i", [3, 4])
    name = "abc"
    raw = b"xy"

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        return dict.fromkeys(("points", "steps", "name", "raw"), "")


def test_values_of_a_message_of_rclpy_have_their_path_for_a_name() -> None:
    assert list(gen_msg_values(Path2())) == [
        ("points[0].x", 1.0),
        ("points[1].x", 2.0),
        ("steps[0]", 3),
        ("steps[1]", 4),
        ("name", "abc"),
        ("raw", b"xy"),
    ]


def test_values_of_a_message_of_the_package_rosbags_too() -> None:
    time = typestore().types["builtin_interfaces/msg/Time"](1, 2)
    assert list(gen_msg_values(time, "stamp")) == [("stamp.sec", 1), ("stamp.nanosec", 2)]


def test_beside_a_script_it_needs_nothing_else(tmp_path: Path) -> None:
    copy(rosbags_common.__file__, tmp_path)
    (tmp_path / "script.py").write_text(
        "from rosbags_common import write_provenance_entry\n"
        "write_provenance_entry('p.json', 'out', ['in'], 'script')\n"
    )
    command = [sys.executable, "-I", "-S", "-c", _run_beside(tmp_path)]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert json.loads((tmp_path / "p.json").read_text())["entries"][0]["plugin"] == "script"


def _run_beside(folder: Path) -> str:
    return f"import sys; sys.path[:0] = [{str(folder)!r}]; import script"
