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
from finished_campaigns import NAME, finished_campaign
from ros_bags import Bag

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
    assert "4 worked on" in done.stdout
    assert "there is no bag" in done.stdout
    assert "(c-2/1)" in done.stdout
    query = (
        "SELECT run, data, param_x FROM rosbag2__text JOIN runs USING (config, run) ORDER BY run"
    )
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
        "c-1/0/rosout.csv": ("rosbags_rosout_to_csv", ["c-1/0/rosbag2"]),
        "c-1/0/poses.csv": ("rosbags_tf_to_csv", ["c-1/0/rosbag2"]),
        "c-1/0/rosbag2__text.csv": ("rosbags_to_csv", ["c-1/0/rosbag2"]),
    }
    graph = json.loads((campaign / "metadata.prov.json").read_text())
    made = [n for n in graph["@graph"] if str(n.get("@id", "")).endswith("c-1/0/poses.csv")]
    assert made
    again = vast("results", "postprocess", "-r", campaign.parent)
    assert again.stdout == f"{NAME}: 4 runs, nothing changed\n"


def test_a_new_command_reads_only_what_it_needs(campaign: Path) -> None:
    vast("results", "postprocess", "-r", campaign.parent, "--skip", "rosbags_to_csv", "--skip-db")
    assert not (campaign / "c-1/0/rosbag2__text.csv").exists()
    assert not (campaign / "_execution/tables.duckdb").exists()
    poses = campaign / "c-1/0/poses.csv"
    before = poses.stat().st_mtime_ns
    vast("results", "postprocess", "-r", campaign.parent, "--skip-rosout", "--skip-metadata")
    assert (campaign / "c-1/0/rosbag2__text.csv").exists()
    assert poses.stat().st_mtime_ns == before


def test_wrong_parameters_of_one_command_leave_the_others_alone(campaign: Path) -> None:
    document = campaign / "_config/c.vast"
    document.write_text(document.read_text().replace("{topics: [/text]}", "{topic: /text}"))
    done = vast("results", "postprocess", "-r", campaign.parent, "--skip-metadata")
    assert done.returncode == 1
    assert f"{NAME}/c-1/0: rosbags_to_csv: " in done.stderr
    assert "topic" in done.stderr
    assert (campaign / "c-1/0/poses.csv").exists()


def test_bad_options_and_folders_have_one_message(tmp_path: Path, campaign: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    assert vast("results", "postprocess", "-r", empty).returncode == 2
    skipped = vast("results", "postprocess", "-r", campaign.parent, "--skip", "poses")
    assert "--skip poses: there is no such command" in skipped.stderr
    missing = vast("results", "postprocess", "-r", campaign.parent, "-o", "none.vast")
    assert missing.stderr == "error: none.vast: there is no such file.\n"
    assert "vast results postprocess" in vast("results", "query", "x", "-r", campaign).stderr
    listed = vast("results", "postprocess-commands").stdout
    assert "rosbags_tf_to_csv" in listed
    assert "frames: ('base_link',) when omitted" in listed
