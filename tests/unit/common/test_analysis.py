"""Reading results as notebooks do, at every level."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from robovast.common.analysis import (
    calculate_speeds_from_poses,
    for_each_run,
    get_behavior_info,
    get_run_status,
    get_scenario_parameter,
    print_bag_topics,
    read_output_csv,
    read_output_files,
    read_output_yaml_list,
    read_run_statuses,
)


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    root = tmp_path / "camp-2026-01-01-000000"
    for config in ("a", "b"):
        (root / config / "_config").mkdir(parents=True)
        text = f"scenario:\n  speed: {config}\n"
        (root / config / "_config" / "scenario.config").write_text(text)
        for run in range(2):
            folder = root / config / str(run)
            folder.mkdir()
            (folder / "out.csv").write_text(f"t,v\n0,{run}\n1,{run + 1}\n")
            (folder / "test.xml").write_text(f'<testsuite failures="{run}" errors="0" time="2"/>')
            (folder / "items.yaml").write_text("items:\n- {n: 1, p: {x: 2}}\n")
    (root / "_jobs" / "0").mkdir(parents=True)
    return root


def read(run: Path) -> pd.DataFrame:
    return read_output_csv(run, "out.csv")


def test_columns_say_which_run_as_far_as_the_level_leaves_it_open(campaign: Path) -> None:
    assert set(read_output_files(campaign / "a" / "0", read)) == {"t", "v"}
    assert set(read_output_files(campaign / "a", read)) == {"t", "v", "run"}
    frame = read_output_files(str(campaign), read)
    assert set(frame) == {"t", "v", "run", "config", "test"}
    assert len(frame) == 8
    assert set(frame["test"]) == {"a/0", "a/1", "b/0", "b/1"}


def test_a_run_without_the_file_is_left_out_with_a_warning(campaign: Path) -> None:
    (campaign / "b" / "1" / "out.csv").unlink()
    with pytest.warns(UserWarning, match="b/1: left out"):
        frame = read_output_files(campaign, read)
    assert len(frame) == 6


def test_statuses(campaign: Path) -> None:
    assert get_run_status(campaign / "a" / "1") == ("failed", "the scenario failed", 2.0)
    frame = read_run_statuses(campaign)
    assert list(frame["status"]) == ["passed", "failed", "passed", "failed"]


def test_parameters_lists_and_each_run(campaign: Path) -> None:
    assert get_scenario_parameter(campaign / "b" / "0", "speed") == "b"
    assert get_scenario_parameter(campaign / "b", "none") is None
    frame = read_output_yaml_list(campaign / "a" / "0", "items.yaml", "items", merge_level=1)
    assert frame.to_dict("records") == [{"n": 1, "p.x": 2}]
    assert for_each_run(campaign, lambda run: run.name) == ["0", "1", "0", "1"]


def test_topics_of_a_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rosbag2").mkdir()
    (tmp_path / "rosbag2" / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  topics_with_message_count:\n"
        "  - {topic_metadata: {name: /tf, type: tf2_msgs/msg/TFMessage}, message_count: 7}\n"
    )
    print_bag_topics(tmp_path)
    assert capsys.readouterr().out == "/tf  tf2_msgs/msg/TFMessage  7\n"


def test_executions_of_a_behaviour() -> None:
    rows = [(1.0, "go", "RUNNING"), (3.0, "go", "SUCCESS"), (4.0, "other", "RUNNING"),
            (5.0, "go", "RUNNING"), (5.5, "go", "FAILURE")]  # fmt: skip
    frame = pd.DataFrame(rows, columns=["timestamp", "behavior_name", "status_name"])
    info = get_behavior_info("go", frame)
    assert list(info["duration"]) == [2.0, 0.5]
    assert list(info["status_name"]) == ["SUCCESS", "FAILURE"]


def test_speeds_do_not_reach_over_runs() -> None:
    frame = pd.DataFrame(
        {
            "run": [0, 0, 1],
            "timestamp": [0.0, 2.0, 9.0],
            "position.x": [0.0, 3.0, 100.0],
            "position.y": [0.0, 4.0, 100.0],
        }
    )
    speeds = calculate_speeds_from_poses(frame)
    assert list(speeds["speed"].fillna(-1)) == [-1, 2.5, -1]
