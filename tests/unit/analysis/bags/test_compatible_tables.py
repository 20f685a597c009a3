"""Tables are as users of the existing tool know them: names, clocks, columns, what is left out."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.campaigns.bags import START, TREE, TREE_TYPE, Bag, rows, typestore

from robovast.analysis.bags import commands
from robovast.analysis.bags.convert import convert_run
from robovast.base.errors import InputError
from robovast.model.document.commands import bag_command, expanded
from robovast.model.document.section import PluginCall


def convert(run: Path, command: str, **parameters: Any) -> set[str]:
    """Names of the files that a command made."""
    done = convert_run(run, [bag_command(command, parameters)])
    assert done.failures == {}
    return {output.path.name for output in done.outputs}


def header(path: Path) -> list[str]:
    return path.read_text().splitlines()[0].split(",")


def log(bag: Bag, level: int, at: float = 0.0) -> None:
    stamp = bag.header(at, "").stamp
    bag.write("/rosout", bag.make("rcl_interfaces/msg/Log", stamp, level, "n", "m", "", "", 1), at)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run whose clock is simulated: stamps begin at 0, messages are received 100 s later."""
    with Bag(tmp_path / "0" / "rosbag2", typestore(**{TREE_TYPE.replace("/", "__"): TREE})) as bag:
        for at in (0, 1, 2):
            transform = bag.transform("map", "base_link", at, (float(at), 0.0, 0.0))
            bag.write("/tf", bag.make("tf2_msgs/msg/TFMessage", [transform]), at + 100.25)
        bag.write("/a/b", bag.make("std_msgs/msg/String", "x"), 3)
        bag.write("/drive/_action/status", bag.make("action_msgs/msg/GoalStatusArray", []), 4)
        for level in (10, 30, 40):
            log(bag, level)
        bag.topic("/silent", "std_msgs/msg/String")
    return tmp_path / "0"


@pytest.mark.parametrize(
    ("command", "parameters", "files"),
    [
        ("rosbags_to_csv", {"topics": ["/a/b", "/silent", "/none"]}, {"rosbag2_a_b.csv"}),
        ("rosbags_to_csv", {}, set()),
        ("rosbags_to_csv", {"colour": "red"}, set()),
        ("rosbags_tf_to_csv", {"colour": "red"}, {"poses.csv"}),
        ("rosbags_tf_to_csv", {"csv_filename": "p.csv"}, {"p.csv"}),
        ("rosbags_tf_to_csv", {"frames": ["none"]}, set()),
        ("rosbags_bt_to_csv", {"csv_filename": "b.csv"}, set()),
        ("rosbags_action_to_csv", {"action": "drive"}, {"action_drive_status.csv"}),
        ("rosbags_action_to_csv", {"action": "none"}, set()),
        ("rosbags_rosout_to_csv", {}, {"rosout.csv"}),
        ("rosbags_rosout_to_csv", {"csv_filename": "l.csv", "min_level": "FATAL"}, {"l.csv"}),
        ("rosbags_tf_to_csv", {"bag_dir": "bags/rosbag2"}, set()),
    ],
)
def test_files_have_their_names_and_without_records_there_is_none_but_of_logs(
    run: Path, command: str, parameters: dict[str, Any], files: set[str]
) -> None:
    assert convert(run, command, **parameters) == files
    assert {path.name for path in run.iterdir()} - {"rosbag2"} == files


def test_a_behaviours_table_may_have_another_name(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2", typestore(**{TREE_TYPE.replace("/", "__"): TREE})) as bag:
        number = bag.make("unique_identifier_msgs/msg/UUID", np.zeros(16, np.uint8))
        kind = "py_trees_ros_interfaces/msg/Behaviour"
        bag.write("/tree", bag.make(TREE_TYPE, [bag.make(kind, "n", "c", number, 1, 2, "")]), 7)
    assert convert(tmp_path, "rosbags_bt_to_csv", csv_filename="b.csv") == {"b.csv"}
    assert rows(tmp_path / "b.csv")[0]["timestamp"] == "1700000007.000000000"


def test_a_pose_has_the_time_at_which_the_bag_received_it(run: Path) -> None:
    convert(run, "rosbags_tf_to_csv")
    table = rows(run / "poses.csv")
    times = [float(row["timestamp"]) - START / 1e9 for row in table]
    assert times == [100.25, 101.25, 102.25]
    assert [row["position.x"] for row in table] == ["0.0", "1.0", "2.0"]


def test_a_fixed_frame_has_the_time_of_what_carries_it(run: Path, tmp_path: Path) -> None:
    with Bag(tmp_path / "1" / "rosbag2") as bag:
        bag.transforms([bag.transform("base_link", "laser", 0)], static=True)
        moved = [bag.transform("map", "base_link", at) for at in (1, 2)]
        bag.write("/tf", bag.make("tf2_msgs/msg/TFMessage", moved), 9)
    convert(tmp_path / "1", "rosbags_tf_to_csv", frames=["laser"])
    times = {row["timestamp"] for row in rows(tmp_path / "1" / "poses.csv")}
    assert times == {"1700000009.000000000"}


def test_all_columns_of_an_action_are_sorted(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        uuid = bag.make("unique_identifier_msgs/msg/UUID", np.full(16, 7, np.uint8))
        info = bag.make("action_msgs/msg/GoalInfo", uuid, bag.header(0, "").stamp)
        goal = bag.make("action_msgs/msg/GoalStatus", info, 2)
        for count in (0, 1, 2, 11):
            array = bag.make("action_msgs/msg/GoalStatusArray", [goal] * count)
            bag.write("/a/_action/status", array, count)
    convert(tmp_path, "rosbags_action_to_csv", action="a")
    path = tmp_path / "action_a_status.csv"
    assert header(path) == sorted(header(path))
    assert "timestamp" in header(path)
    table = rows(path)
    assert [row["status_list_1_status"] for row in table] == ["", "", "2", "2"]
    assert table[3]["status_list_10_goal_info_goal_id_uuid_15"] == "7"
    assert table[2]["timestamp"] == "1700000002.000000000"


@pytest.mark.parametrize(
    ("level", "count"), [("DEBUG", 3), ("WARN", 2), ("error", 1), ("FATAL", 0), (40, 1)]
)
def test_the_least_level_is_a_name(run: Path, level: str | int, count: int) -> None:
    convert(run, "rosbags_rosout_to_csv", min_level=level)
    assert len(rows(run / "rosout.csv")) == count
    assert header(run / "rosout.csv")[:4] == ["timestamp", "stamp", "level", "level_name"]


def test_a_bag_may_have_another_folder(tmp_path: Path) -> None:
    with Bag(tmp_path / "bags" / "mine") as bag:
        bag.transforms([bag.transform("map", "base_link", 1)])
    convert(tmp_path, "rosbags_tf_to_csv", bag_dir="bags/mine")
    assert (tmp_path / "bags" / "poses.csv").is_file()


def test_the_table_of_a_jobs_recording_is_beside_it_and_the_job_stays_as_it_was(
    tmp_path: Path,
) -> None:
    logs = tmp_path / "_jobs" / "job-0" / "logs"
    with Bag(logs / "rosout_bag") as bag:
        log(bag, 20)
    run = tmp_path / "a" / "0"
    run.mkdir(parents=True)
    (run / "job").symlink_to("../../_jobs/job-0")
    os.utime(logs, (1, 1))
    assert convert(run, "rosbags_rosout_to_csv") == {"rosout.csv"}
    assert len(rows(logs / "rosout.csv")) == len(rows(run / "rosout.csv")) == 1
    assert logs.stat().st_mtime == 1


def test_a_link_to_the_job_of_another_campaign_leads_nowhere(tmp_path: Path) -> None:
    for name in ("mine", "other"):
        with Bag(tmp_path / name / "_jobs" / "job-0" / "logs" / "rosout_bag") as bag:
            log(bag, 20)
    run = tmp_path / "mine" / "a" / "0"
    run.mkdir(parents=True)
    other = tmp_path / "other" / "_jobs" / "job-0"
    (run / "job").symlink_to(other)
    assert convert(run, "rosbags_rosout_to_csv") == {"rosout.csv"}
    assert [path.name for path in (other / "logs").iterdir()] == ["rosout_bag"]
    assert (tmp_path / "mine" / "_jobs" / "job-0" / "logs" / "rosout.csv").is_file()


def test_a_process_is_the_commands_that_it_holds(run: Path) -> None:
    plugins = [{"type": "tf_to_csv", "frames": ["base_link"]}, {"type": "to_csv"}]
    success, _, entries = commands.rosbags_process(str(run), str(run), plugins, workers=2)
    assert success
    assert [entry["output"] for entry in entries] == ["poses.csv"]
    call = PluginCall(name="rosbags_process", parameters={"plugins": plugins, "bag_dir": "b"})
    assert [(part.name, part.parameters) for part in expanded([call])] == [
        ("rosbags_tf_to_csv", {"bag_dir": "b", "frames": ["base_link"]}),
        ("rosbags_to_csv", {"bag_dir": "b"}),
    ]


@pytest.mark.parametrize("plugins", [[{"type": "to_cvs"}], [{}], "tf_to_csv"])
def test_a_process_of_something_else_is_refused(plugins: Any) -> None:
    with pytest.raises(InputError, match=r"^rosbags_process: .*plugins"):
        expanded([PluginCall(name="rosbags_process", parameters={"plugins": plugins})])
