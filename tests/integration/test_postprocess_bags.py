"""Bags, tables, metadata and graph by one `vast results postprocess`, and queries over them."""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from support.campaigns.bags import Bag
from support.campaigns.finished import NAME, finished_campaign

from robovast.analysis.postprocessing.events import Options
from robovast.analysis.postprocessing.session import postprocess
from robovast_cli.commands.results.postprocess import View

VAST = Path(sys.executable).with_name("vast")
BAGS = """\
  - rosbags_tf_to_csv: {frames: [base_link]}
  - rosbags_to_csv: {topics: [/text]}
  - rosbags_rosout_to_csv
"""


def vast(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [str(VAST), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def record(run: Path, *texts: str) -> None:
    with Bag(run / "rosbag2") as bag:
        for at, text in enumerate(texts):
            bag.write("/text", bag.make("std_msgs/msg/String", text), at)
        bag.transforms([bag.transform("map", "base_link", 1)])


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    folder = finished_campaign(tmp_path, 4, BAGS)
    record(folder / "c-1/0", "a, b")
    record(folder / "c-1/1", "c")
    record(folder / "c-2/0", "d")
    (folder / "c-2/0/rosbag2/rosbag2.mcap").write_bytes(b"")
    return folder


def test_bags_become_tables_that_can_be_asked(campaign: Path) -> None:
    done = vast("results", "postprocess", "-r", campaign.parent)
    assert done.returncode == 0, done.stderr
    assert "4 processed" in done.stdout
    assert "there is no bag" in done.stdout
    assert "(c-2/1)" in done.stdout
    query = "SELECT run, data, param_x FROM rosbag2_text JOIN runs USING (config, run) ORDER BY run"
    answer = vast("results", "query", query, "-r", campaign.parent, "-o", "json")
    assert json.loads(answer.stdout) == [
        {"run": 0, "data": "a, b", "param_x": 0},
        {"run": 1, "data": "c", "param_x": 1},
    ]
    table = vast("results", "query", "SELECT count(*) AS n FROM poses", "-r", campaign, "-o", "csv")
    assert list(csv.reader(io.StringIO(table.stdout))) == [["n"], ["2"]]
    record_ = yaml.safe_load((campaign / "c-1/0/postprocessing.yaml").read_text())
    found = {e["output"]: (e["plugin"], e["sources"]) for e in record_["entries"]}
    assert found == {
        "c-1/0/poses.csv": ("rosbags_tf_to_csv", ["c-1/0/rosbag2"]),
        "c-1/0/rosbag2_text.csv": ("rosbags_to_csv", ["c-1/0/rosbag2"]),
    }
    graph = json.loads((campaign / "metadata.prov.json").read_text())
    made = [n for n in graph["@graph"] if str(n.get("@id", "")).endswith("c-1/0/poses.csv")]
    assert made
    again = vast("results", "postprocess", "-r", campaign.parent)
    assert again.stdout == f"{NAME}: 4 runs, nothing changed\n"


def test_a_new_command_reads_only_what_it_needs(campaign: Path) -> None:
    vast("results", "postprocess", "-r", campaign.parent, "--skip", "rosbags_to_csv", "--skip-db")
    assert not (campaign / "c-1/0/rosbag2_text.csv").exists()
    assert not (campaign / "_execution/tables.duckdb").exists()
    poses = campaign / "c-1/0/poses.csv"
    before = poses.stat().st_mtime_ns
    vast("results", "postprocess", "-r", campaign.parent, "--skip-rosout", "--skip-metadata")
    assert (campaign / "c-1/0/rosbag2_text.csv").exists()
    assert poses.stat().st_mtime_ns == before


def test_wrong_parameters_of_one_command_leave_the_others_alone(campaign: Path) -> None:
    document = campaign / "_config/c.vast"
    document.write_text(document.read_text().replace("{topics: [/text]}", "{topic: /text}"))
    done = vast("results", "postprocess", "-r", campaign.parent, "--skip-metadata")
    assert done.returncode == 1
    said = "unknown parameter `topic` (did you mean `topics`?)"
    assert done.stderr.count(f"{NAME}: rosbags_to_csv: ") == done.stderr.count(said) == 1
    assert (campaign / "c-1/0/poses.csv").exists()


def test_a_missing_extra_fails_the_command_that_needs_it_once(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    document = campaign / "_config/c.vast"
    document.write_text(document.read_text() + "  - rosbags_to_webm\n")
    monkeypatch.setitem(sys.modules, "av", None)
    options = Options(skip_tables=True, skip_metadata=True)
    (summary,) = postprocess(campaign, options, View())
    (failure,) = summary.failures
    assert (failure.command, failure.where) == ("rosbags_to_webm", "")
    assert "needs the extra `video`" in failure.message
    assert (campaign / "c-1/1/poses.csv").is_file()
    assert (campaign / "c-1/1/rosbag2_text.csv").is_file()


def test_what_is_said_of_a_bag_is_said_by_the_command_that_it_is_about(campaign: Path) -> None:
    document = campaign / "_config/c.vast"
    document.write_text(document.read_text().replace("[/text]}", "[/none]}\n  - rosbags_bt_to_csv"))
    done = vast("results", "postprocess", "-r", campaign, "--skip-db", "--skip-metadata")
    assert done.returncode == 0, done.stderr
    assert (
        "rosbags_to_csv: rosbag2 has no message on /none; it has /text, /tf (c-1/0" in done.stdout
    )
    assert "rosbags_bt_to_csv: rosbag2 has no message on a topic of type py_trees" in done.stdout
    assert "rosbags_tf_to_csv: rosbag2 has no message on /none" not in done.stdout


@pytest.mark.parametrize(
    ("options", "logs"),
    [
        ([], True),
        (["--skip-rosout"], False),
        (["--skip", "rosbags_rosout_to_csv"], False),
        (["--skip", "rosbags_process"], True),
        (["--skip", "rosbags_tf_to_csv"], True),
    ],
)
def test_logs_are_converted_unless_that_is_skipped(
    tmp_path: Path, options: list[str], logs: bool
) -> None:
    process = "  - rosbags_process: {plugins: [{type: tf_to_csv}, {type: bt_to_csv}]}\n"
    campaign = finished_campaign(tmp_path, 1, process)
    record(campaign / "c-1/0", "a")
    recording = campaign / "_jobs/job-0/logs/rosout_bag"
    with Bag(recording) as bag:
        stamp = bag.header(0, "").stamp
        bag.write("/rosout", bag.make("rcl_interfaces/msg/Log", stamp, 20, "n", "m", "", "", 1))
    arguments = ["-r", campaign, "--skip-db", "--skip-metadata"]
    done = vast("results", "postprocess", *arguments, *options)
    assert done.returncode == 0, done.stderr
    assert (campaign / "c-1/0/rosout.csv").exists() is logs
    assert (recording.parent / "rosout.csv").exists() is logs
    skipped = {"rosbags_process", "rosbags_tf_to_csv"}.intersection(options)
    assert (campaign / "c-1/0/poses.csv").exists() is not bool(skipped)
    again = vast("results", "postprocess", *arguments, *options)
    assert again.stdout.endswith("1 run, nothing changed\n")


def test_logs_that_nobody_asked_for_are_not_missed(tmp_path: Path) -> None:
    campaign = finished_campaign(tmp_path, 2, "  - rosbags_tf_to_csv\n")
    record(campaign / "c-1/0", "a")
    arguments = ["-r", campaign, "--skip-db", "--skip-metadata"]
    done = vast("results", "postprocess", *arguments)
    assert "/rosout" not in done.stdout
    assert not list(campaign.rglob("rosout.csv"))
    document = campaign / "_config/c.vast"
    document.write_text(document.read_text() + "  - rosbags_rosout_to_csv\n")
    done = vast("results", "postprocess", *arguments, "--force")
    assert "neither its bag nor its job's recording has /rosout (c-1/0" in done.stdout


def test_logs_that_nobody_asked_for_need_no_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    campaign = finished_campaign(tmp_path, 1)
    record(campaign / "c-1/0", "a")
    monkeypatch.setitem(sys.modules, "rosbags", None)
    options = Options(skip_tables=True, skip_metadata=True)
    (summary,) = postprocess(campaign, options, View())
    assert summary.failures == []
    said = capsys.readouterr().out
    assert "Logs are not converted: rosbags_rosout_to_csv needs the extra `ros`" in said


def test_bad_options_and_folders_have_one_message(tmp_path: Path, campaign: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    assert vast("results", "postprocess", "-r", empty).returncode == 2
    skipped = vast("results", "postprocess", "-r", campaign.parent, "--skip", "poses")
    assert "--skip poses: there is no such command" in skipped.stderr
    missing = vast("results", "postprocess", "-r", campaign.parent, "-o", "none.vast")
    assert missing.stderr == "error: none.vast: there is no such file\nhint: check the path\n"
    assert "vast results postprocess" in vast("results", "query", "x", "-r", campaign).stderr
    listed = vast("results", "postprocess-commands").stdout
    assert "rosbags_tf_to_csv" in listed
    assert 'default ["base_link"]  the frames.' in listed
