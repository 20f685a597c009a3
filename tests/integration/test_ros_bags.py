"""What nodes of ROS 2 published comes out of a bag as rclpy itself reads it."""

from __future__ import annotations

import base64
import csv
import json
import math
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import StoragePlugin
from support.campaigns.bags import Bag, typestore
from support.campaigns.local import ros_environment

import rosbags_common
from robovast.analysis.bags.convert import convert_run
from robovast.model.document.commands import bag_command, flat

RECORDER = Path(__file__).with_name("ros_recorder.py")


@pytest.fixture(scope="session")
def ros_python() -> Path:
    """The Python of an environment with rclpy."""
    return Path(ros_environment(), "bin", "python")


@pytest.fixture(scope="session")
def recording(ros_python: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What the recorder prints."""
    folder = tmp_path_factory.mktemp("ros")
    shutil.copy(RECORDER, folder)
    shutil.copy(rosbags_common.__file__, folder)
    environment = {
        "HOME": str(folder),
        "PATH": os.environ["PATH"],
        "ROS_LOG_DIR": str(folder),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(os.getpid() % 100),
    }
    command = [ros_python, folder / RECORDER.name]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def write_mcap(folder: Path, recording: list[dict[str, Any]]) -> None:
    """As a recorder of ROS 2 Jazzy writes it."""
    folder.mkdir(parents=True)
    with (folder / "rosbag2_0.mcap").open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for line in recording:
            if "definition" in line:
                text = line["definition"].encode()
                schema = writer.register_schema(line["type"], "ros2msg", text)
                channels[line["topic"]] = writer.register_channel(line["topic"], "cdr", schema)
            else:
                data = base64.b64decode(line["data"])
                writer.add_message(channels[line["topic"]], line["time"], data, line["time"])
        writer.finish()


def write_sqlite(folder: Path, recording: list[dict[str, Any]]) -> None:
    types = {line["topic"]: line["type"] for line in recording if "definition" in line}
    with Bag(folder, typestore(), StoragePlugin.SQLITE3) as bag:
        for line in recording:
            if "data" in line:
                topic = line["topic"]
                bag.write_raw(topic, types[topic], base64.b64decode(line["data"]))


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def agrees(text: str, value: object) -> bool:
    if isinstance(value, str | bool):
        return text == str(value)
    number = float(text)
    if isinstance(value, float):
        both_nan = math.isnan(value) and math.isnan(number)
        return both_nan or math.isclose(number, value, rel_tol=1e-7)
    return int(text) == value


@pytest.mark.parametrize("write", [write_mcap, write_sqlite])
def test_every_cell_is_what_rclpy_reads(
    tmp_path: Path, recording: list[dict[str, Any]], write: Any
) -> None:
    write(tmp_path / "rosbag2", recording)
    topics = [line["topic"] for line in recording if "definition" in line]
    done = convert_run(tmp_path, [bag_command("rosbags_to_csv", {"topics": topics})])
    assert [warning for warning in done.warnings if "metadata.yaml" not in warning] == []
    for topic in topics:
        rows = table(tmp_path / f"rosbag2_{flat(topic)}.csv")
        expected = [
            line["values"] for line in recording if "data" in line and line["topic"] == topic
        ]
        assert len(rows) == len(expected) >= 20
        for row, values in zip(rows, expected, strict=True):
            cells = {name: row[name] for name in list(row)[2:]}
            assert all(agrees(cells[name], value) for name, value in values.items())
            assert not any(cells[name] for name in cells.keys() - values.keys())
        assert list(rows[0])[2:] == sorted(set().union(*expected))


def test_what_a_node_logged_is_in_the_log_table(
    tmp_path: Path, recording: list[dict[str, Any]]
) -> None:
    write_mcap(tmp_path / "rosbag2", recording)
    convert_run(tmp_path, [bag_command("rosbags_rosout_to_csv", {"min_level": 30})])
    rows = table(tmp_path / "rosout.csv")
    assert [row["msg"] for row in rows] == [f'step {step}, "so far"' for step in range(20)]
    assert {(row["level"], row["level_name"], row["name"]) for row in rows} == {
        ("30", "WARN", "recorder")
    }
    assert {Path(row["file"]).name for row in rows} == {RECORDER.name}
    assert all(0 <= float(row["timestamp"]) - float(row["stamp"]) < 30 for row in rows)
