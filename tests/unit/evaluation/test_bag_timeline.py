"""A bag's timeline has every message in its place, whatever became of the recorder."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing, suppress
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin
from support.campaigns.bags import START, Bag

from robovast.base.bounds import Bound
from robovast.base.errors import InputError
from robovast.evaluation.bag_timeline import BINS, Timeline, read_timeline

ENDLESS = """
CREATE TABLE topics (id, name, type, serialization_format);
CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n)
SELECT 1 AS topic_id, i AS timestamp, x'00' AS data FROM n;
"""
STRING = "std_msgs/msg/String"


def record(folder: Path, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
    with Bag(folder / "rosbag2", storage=storage) as bag:
        message = bag.make(STRING, "x" * 50)
        for i in range(300):
            bag.write("/steady", message, at=i / 10)
        bag.write("/late", message, at=29.9)
        bag.topic("/silent", STRING)
    return folder / "rosbag2"


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_every_message_is_in_its_part_of_the_time(tmp_path: Path, storage: StoragePlugin) -> None:
    record(tmp_path, storage)
    found = read_timeline(tmp_path, "rosbag2")
    assert found.topics == {"/late": [0] * (BINS - 1) + [1], "/steady": [2] * BINS}
    assert found.start == pytest.approx(START / 1e9, abs=0.06)
    assert found.end - found.start == pytest.approx(29.9, abs=0.1)


def test_a_file_that_ends_anywhere_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    (path,) = record(tmp_path).glob("*.mcap")
    content = path.read_bytes()
    found = whole = read_timeline(tmp_path, "rosbag2")
    for length in range(8, len(content), 997):
        path.write_bytes(content[:length])
        with suppress(InputError):  # the channels may be behind the cut
            found = read_timeline(tmp_path, "rosbag2")
        assert found == whole or sum(map(sum, found.topics.values())) <= 301


def test_lengths_that_lie_do_no_harm(tmp_path: Path) -> None:
    (tmp_path / "rosbag2").mkdir()
    path = tmp_path / "rosbag2" / "0.mcap"
    for opcode in range(16):
        lie = bytes([opcode]) + b"\xff" * 8 + b"\0" * 100
        truth = bytes([opcode]) + (3).to_bytes(8, "little") + b"\xff" * 3
        path.write_bytes(b"\x89MCAP0\r\n" + truth + lie)
        with suppress(InputError):  # which says that it is damaged
            assert read_timeline(tmp_path, "rosbag2") == Timeline(0, 0, {})


def test_what_is_no_bag_is_an_error_in_words(tmp_path: Path) -> None:
    (tmp_path / "rosbag2").mkdir()
    for name, content in (("0.mcap", b"text"), ("0.db3", b"text" * 100)):
        (tmp_path / "rosbag2" / name).write_bytes(content)
        with pytest.raises(InputError, match=r"is not an MCAP file|cannot be read"):
            read_timeline(tmp_path, "rosbag2")
        (tmp_path / "rosbag2" / name).unlink()
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is not a folder"):
        read_timeline(tmp_path, "file")


def test_zeros_after_the_messages_end_the_count(tmp_path: Path) -> None:
    (path,) = record(tmp_path).glob("*.mcap")
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2)
    whole = read_timeline(tmp_path, "rosbag2")
    os.truncate(path, 300 << 30)
    found = read_timeline(tmp_path, "rosbag2")
    for topic, counts in found.topics.items():
        assert 0 < sum(counts) <= sum(whole.topics[topic]) + 1


def test_more_records_than_can_be_counted_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path)
    monkeypatch.setattr("robovast.evaluation.drive.recording.Bound", lambda: Bound(records=3))
    with pytest.raises(InputError, match="too many records"):
        read_timeline(tmp_path, "rosbag2")


def test_a_view_without_end_is_no_table(tmp_path: Path) -> None:
    (tmp_path / "rosbag2").mkdir()
    with closing(sqlite3.connect(tmp_path / "rosbag2" / "0.db3")) as database:
        database.executescript(ENDLESS)
    with pytest.raises(InputError, match="no table messages"):
        read_timeline(tmp_path, "rosbag2")
