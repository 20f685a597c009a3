"""Reading results as notebooks do, at every level."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from robovast.common import analysis, campaign_data
from robovast.common.analysis import (
    calculate_speeds_from_poses,
    for_each_run,
    get_behavior_info,
    get_factors,
    get_run_status,
    get_scenario_parameter,
    print_bag_topics,
    read_output_csv,
    read_output_files,
    read_output_yaml_list,
    read_run_statuses,
)

TREE = """\
{-} drive [✕]
    --> turn [✓] -- done
    --> reach [✕] -- no path
"""


def suite(failed: bool = False, text: str = "", message: str = "Tree failed") -> str:
    inside = f'<failure message="{message}">{text}</failure>' if failed else ""
    return (
        f'<testsuite tests="1" failures="{int(failed)}" errors="0" time="2">'
        '<properties><property name="start_time" value="1700000000.5"/></properties>'
        f'<testcase name="drive">{inside}</testcase></testsuite>'
    )


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """Two configurations, the first without the second's parameter, of two runs each."""
    root = tmp_path / "camp-2026-01-01-000000"
    for config, extra in (("a-1", ""), ("b", "  label: x\n")):
        (root / config / "_config").mkdir(parents=True)
        text = f"scenario:\n  rate: 0.5\n  goal: {{y: 2.0, x: 1.0}}\n{extra}"
        (root / config / "_config" / "scenario.config").write_text(text)
        for run in range(2):
            folder = root / config / str(run)
            folder.mkdir()
            (folder / "out.csv").write_text(f"# comment\nstep,value\n0,{run + 1.5}\n")
            (folder / "test.xml").write_text(suite(failed=run == 1, text=TREE))
    (root / "_jobs" / "job-0").mkdir(parents=True)
    (root / "_jobs" / "job-0" / "test.xml").write_text(suite())
    return root


def read(run: Path) -> pd.DataFrame:
    return read_output_csv(run, "out.csv", skiprows=1)


@pytest.mark.parametrize(("scope", "rows"), [("", 4), ("a-1", 2), ("a-1/0", 1)])
def test_every_scope_has_the_run_its_configuration_and_parameters(
    campaign: Path, scope: str, rows: int
) -> None:
    frame = read_output_files(str(campaign / scope), read)
    names = ["step", "value", "run", "config", "goal", "rate"]
    assert [name for name in frame if name != "label"] == names
    assert len(frame) == rows
    assert frame["step"].dtype == "int64"
    assert frame["value"].dtype == "float64"
    assert {str(frame[name].dtype) for name in names[2:]} == {"category"}
    assert frame.iloc[0][names].tolist() == [0, 1.5, "0", "a-1", "x: 1.0\ny: 2.0\n", 0.5]


def test_a_parameter_that_a_configuration_lacks_is_missing(campaign: Path) -> None:
    frame = read_output_files(campaign, read)
    assert frame.loc[frame["config"] == "a-1", "label"].isna().all()
    assert set(frame.loc[frame["config"] == "b", "label"]) == {"x"}
    assert list(frame["config"].cat.categories) == ["a-1", "b"]


def test_what_a_reader_calls_run_is_replaced(campaign: Path) -> None:
    frame = read_output_files(campaign / "b", lambda _: pd.DataFrame({"run": [7], "z": [1]}))
    assert list(frame["run"]) == ["0", "1"]
    assert next(iter(frame)) == "z"


def test_a_run_without_the_file_is_left_out_with_a_warning(campaign: Path) -> None:
    (campaign / "b" / "1" / "out.csv").unlink()
    with pytest.warns(UserWarning, match="1 of 4 runs are skipped: b/1: it has no out.csv$"):
        frame = read_output_files(campaign, read)
    assert len(frame) == 3
    empty = read_output_files(campaign, lambda _: None)
    assert empty.empty


def test_runs_that_are_left_out_are_one_warning(campaign: Path) -> None:
    for config in ("a-1", "b"):
        (campaign / config / "1" / "out.csv").write_text("")
    expected = r"^2 of 4 runs are skipped: a-1/1: EmptyDataError: .* \(and 1 more\)$"
    with pytest.warns(UserWarning, match=expected) as told:
        assert len(read_output_files(campaign, read)) == 2
    assert len(told) == 1


def test_what_holds_no_run_is_told(campaign: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no such folder"):
        read_output_files(tmp_path / "absent", read)
    with pytest.raises(ValueError, match="no run"):
        for_each_run(campaign / "b" / "_config", print)
    told = r"none of its 4 runs could be read: a-1/0: it has no absent.csv \(and 3 more\)"
    with pytest.raises(ValueError, match=told):
        read_output_files(campaign, lambda run: read_output_csv(run, "absent.csv"))
    with pytest.raises(ValueError, match="no such folder"):
        read_run_statuses(tmp_path / "absent")
    (tmp_path / "empty").mkdir()
    assert list(read_run_statuses(tmp_path / "empty")) == []


def test_statuses(campaign: Path) -> None:
    (campaign / "b" / "0" / "test.xml").write_text("no xml")
    assert get_run_status(campaign / "a-1" / "0") == ("passed", None)
    assert get_run_status(campaign / "b" / "0") == ("unknown", None)
    frame = read_run_statuses(campaign)
    assert list(frame) == ["run", "config", "status", "summary"]
    assert frame.fillna("").to_numpy().tolist() == [
        ["0", "a-1", "passed", ""],
        ["1", "a-1", "failed", "no path"],
        ["0", "b", "unknown", ""],
        ["1", "b", "failed", "no path"],
    ]


@pytest.mark.parametrize(
    ("text", "message", "summary"),
    [
        ("[✕] a -- first\n[✕] -- second\n[✓] -- last", "", "second"),
        ("[o] a\n[✓] -- arrived", "", "arrived"),
        ("", "collision", "collision"),
        ("one\ntwo", "", None),
    ],
)
def test_a_failure_is_summed_up_by_what_failed(
    tmp_path: Path, text: str, message: str, summary: str | None
) -> None:
    (tmp_path / "test.xml").write_text(suite(failed=True, text=text, message=message))
    assert get_run_status(tmp_path) == ("failed", summary)


def test_a_run_without_a_verdict_says_what_its_record_knows(campaign: Path) -> None:
    folder = campaign / "b" / "2"
    folder.mkdir()
    record = {
        "campaign": "c", "variant": "b", "entry": "b", "run": 2, "id": 2, "verdict": "errored",
        "reason": "stopped after 8 s", "started_at": "", "finished_at": "", "duration": 8.0,
        "exit_code": None, "attempt": 1, "job": "job-0", "runtime": "process", "image": "",
        "image_digest": "", "host": "",
    }  # fmt: skip
    (folder / "run.json").write_text(json.dumps(record))
    assert get_run_status(folder) == ("unknown", "stopped after 8 s")


def test_what_is_not_there_is_a_file_that_is_not_found(campaign: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_output_csv(campaign / "a-1" / "0", "absent.csv")
    (campaign / "b" / "_config" / "scenario.config").unlink()
    with pytest.raises(FileNotFoundError):
        get_scenario_parameter(campaign / "b", "label")


def test_parameters_and_each_run(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert get_scenario_parameter(campaign / "b" / "0", "label") == "x"
    assert get_scenario_parameter(campaign / "b", "none") is None

    assert get_factors(campaign / "a-1" / "0") == {"rate": 0.5, "goal": {"x": 1.0, "y": 2.0}}
    record = "config_identifier: abc\nfactors: {clutter: {value: 0.25, unit: 1/m}}\n"
    (campaign / "b" / "_config" / "config.yaml").write_text(record)
    assert get_factors(campaign / "b") == {"clutter": 0.25}

    def named(run: Path) -> str:
        return {"0": "first"}[run.name]

    assert for_each_run(campaign, named) == ["first", "first"]
    assert "a-1/1: KeyError: '1'" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("level", "columns"),
    [
        (0, ["feedback", "l"]),
        (1, ["feedback_pose", "l_0", "l_1"]),
        (2, ["feedback_pose_x", "l_0", "l_1_z"]),
    ],
)
def test_lists_of_nested_items(tmp_path: Path, level: int, columns: list[str]) -> None:
    (tmp_path / "items.yaml").write_text(
        "items: [{feedback: {pose: {x: 1}}, l: [1, {z: 3}]}]\nnone: {}\n"
    )
    assert list(read_output_yaml_list(tmp_path, "items.yaml", "items", level)) == columns
    with pytest.raises(ValueError, match="`none` is not a list"):
        read_output_yaml_list(tmp_path, "items.yaml", "none")
    with pytest.raises(KeyError):
        read_output_yaml_list(tmp_path, "items.yaml", "absent")


def test_topics_of_a_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rosbag2").mkdir()
    (tmp_path / "rosbag2" / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  topics_with_message_count:\n"
        "  - {topic_metadata: {name: /tf, type: tf2_msgs/msg/TFMessage}, message_count: 7}\n"
    )
    print_bag_topics(tmp_path)
    assert capsys.readouterr().out == "/tf  tf2_msgs/msg/TFMessage  7\n"
    with pytest.raises(ValueError, match="is not a valid bag"):
        print_bag_topics(tmp_path, "absent")


BEHAVIORS = [
    (0.0, "go", 1, "RUNNING", "0"),
    (1.0, "go", 1, "RUNNING", "1"),
    (3.0, "go", 2, "RUNNING", "1"),
    (5.0, "go", 1, "FAILURE", "1"),
    (10.0, "go", 1, "SUCCESS", "0"),
    (11.0, "other", 3, "RUNNING", "0"),
]
COLUMNS = ["timestamp", "behavior_name", "behavior_id", "status_name", "run"]


def test_executions_of_a_behaviour_are_told_apart_by_run() -> None:
    frame = pd.DataFrame(BEHAVIORS, columns=COLUMNS).assign(config="a")
    info = get_behavior_info("go", frame)
    assert list(info) == [
        "behavior_name", "id", "start_time", "end_time", "duration", "run", "config",
    ]  # fmt: skip
    assert info[["duration", "run"]].to_numpy().tolist() == [[10.0, "0"], [4.0, "1"]]
    assert list(get_behavior_info("absent", frame)) == [
        "behavior_name", "id", "duration", "run", "config",
    ]  # fmt: skip
    assert list(get_behavior_info("other", frame)) == []
    with pytest.raises(KeyError):
        get_behavior_info("go", frame.drop(columns="run"))


def test_speeds_are_those_to_the_next_pose() -> None:
    frame = pd.DataFrame(
        {
            "timestamp": [0.0, 1.0, 2.0, 3.0],
            "position.x": [0.0, 1.0, 1.0, 1.0],
            "position.y": [0.0, 0.0, 2.0, 2.0],
            "orientation.yaw": [0.0, 0.5, 3.0, -3.0],
        }
    ).assign(run="0", config="a")
    speeds = calculate_speeds_from_poses(frame)
    assert list(speeds) == [
        "run", "config", "position.x", "position.y", "orientation.yaw", "timestamp",
        "linear_speed", "angular_speed", "dt",
    ]  # fmt: skip
    assert list(speeds["linear_speed"]) == [1, 2, 0]
    assert np.allclose(speeds["angular_speed"], [0.5, 2.5, 0.2832], atol=1e-4)


def test_speeds_do_not_reach_over_runs_frames_and_equal_times() -> None:
    frame = pd.DataFrame(
        {
            "run": ["0", "0", "0", "1", "0"],
            "frame": ["a", "a", "a", "a", "b"],
            "timestamp": [0.0, 2.0, 2.0, 9.0, 1.0],
            "position.x": [0.0, 3.0, 4.0, 100.0, 50.0],
            "position.y": [0.0, 4.0, 4.0, 100.0, 50.0],
            "orientation.yaw": 0.0,
        }
    )
    assert list(calculate_speeds_from_poses(frame)["linear_speed"]) == [2.5]


@pytest.mark.parametrize("numbered", [True, False])
@pytest.mark.parametrize("shift", [0.0, 0.5])
def test_speeds_do_not_reach_over_resets(numbered: bool, shift: float) -> None:
    """Whether a column numbers the episodes or only the timestamps jump back."""
    episodes = [(start + step + number * shift, number, start * 100.0 + step * 2)
                for number, start in enumerate((0, 50, 100) if numbered else (0, 0, 0))
                for step in range(4)]  # fmt: skip
    frame = pd.DataFrame(episodes, columns=["timestamp", "episode", "position.x"]).assign(
        run="0", config="a", frame="base_link", **{"position.y": 0.0, "orientation.yaw": 0.0}
    )
    speeds = calculate_speeds_from_poses(frame if numbered else frame.drop(columns="episode"))
    assert list(speeds["linear_speed"]) == [2.0] * 9
    mixed = pd.concat([frame, frame[:4].drop(columns="episode").assign(run="1")])
    assert len(calculate_speeds_from_poses(mixed)) == 12


def test_a_campaign_in_plain_values(campaign: Path) -> None:
    configs = campaign_data.list_config_dirs(campaign)
    assert [path.name for path in configs] == ["a-1", "b"]
    (campaign / "b" / "10").mkdir()
    (campaign / "b" / "2").mkdir()
    runs = campaign_data.list_run_dirs(campaign / "b")
    assert [run.name for run in runs] == ["0", "1", "2", "10"]
    assert campaign_data.list_run_dirs(campaign / "absent") == []
    assert campaign_data.read_test_result(runs[0]) == {
        "success": True, "duration_sec": 2.0, "start_time": "2023-11-14T22:13:20.500000+00:00",
        "errors": 0, "failures": 0, "tests": 1, "failure_message": None,
    }  # fmt: skip
    failed = campaign_data.read_test_result(runs[1])
    assert (failed["success"], failed["failures"]) == (False, 1)
    assert "no path" in failed["failure_message"]
    assert campaign_data.aggregate_run_status(runs) == "mixed"
    assert campaign_data.aggregate_run_status(runs[:1]) == "passed"
    assert campaign_data.aggregate_run_status(runs[1:2]) == "failed"
    assert campaign_data.aggregate_run_status(runs[2:]) == "no_runs"
    assert campaign_data.read_scenario_config(campaign / "a-1")["scenario"]["rate"] == 0.5


def test_what_a_campaign_lacks_is_a_file_that_is_not_found(campaign: Path) -> None:
    run = campaign / "a-1" / "0"
    for read_it, folder in (
        (campaign_data.read_test_result, campaign),
        (campaign_data.read_scenario_config, campaign),
        (campaign_data.read_sysinfo, run),
        (campaign_data.read_execution_metadata, campaign),
        (campaign_data.read_resolved_configurations, campaign),
    ):
        with pytest.raises(FileNotFoundError):
            read_it(folder)
    for name in ("_execution/execution.yaml", "_transient/configurations.yaml"):
        (campaign / name).parent.mkdir()
        (campaign / name).write_text("runs: 2\n")
    assert campaign_data.read_execution_metadata(campaign) == {"runs": 2}
    assert campaign_data.read_resolved_configurations(campaign) == {"runs": 2}
    (run / "job").symlink_to("../../_jobs/job-0")
    (campaign / "_jobs" / "job-0" / "sysinfo.yaml").write_text("cpu_count: 4\n")
    assert campaign_data.read_sysinfo(run) == {"cpu_count": 4}
    (run / "job").unlink()
    (run / "run.json").write_text('{"job": "job-0"}')
    assert campaign_data.read_sysinfo(run) == {"cpu_count": 4}


def test_the_modules_that_notebooks_name_hold_the_functions() -> None:
    assert analysis.common.read_output_csv is read_output_csv
    assert analysis.ros2.get_bag_info is analysis.get_bag_info
