"""A recorded drive is played from its bag in parts; what a bag lacks is said, the rest is shown."""

from __future__ import annotations

import io
import math
import os
import sqlite3
import struct
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from support.campaigns.bags import START, Bag
from support.campaigns.drives import PICTURE, DriveBag, around, photo, record_drive
from support.patience import PATIENCE

from robovast.base.errors import InputError
from robovast.evaluation.drive import pictures
from robovast.evaluation.drive import recording as recording_module
from robovast.evaluation.drive.clock import Clock
from robovast.evaluation.drive.drives import Drive, Drives
from robovast.evaluation.drive.part import Part
from robovast.evaluation.drive.picture_size import size_of
from robovast.evaluation.drive.recording import RecordedMessage, Recording
from robovast.evaluation.drive.roles import ODOMETRY, TRANSFORMS, cast

SECOND = 1_000_000_000


def opened(folder: Path, **named: str) -> Drive:
    return Drives(folder.parent.resolve()).drive(folder.name, named)


def parts_of(drive: Drive, scans: bool = True) -> list[Part]:
    return [drive.part(n, scans=scans) for n in range(len(drive.overview().bounds) - 1)]


def remarks_of(drive: Drive) -> str:
    return " ".join([*drive.overview().remarks, *(r for p in parts_of(drive) for r in p.remarks)])


@pytest.mark.parametrize(
    ("recorded", "pose", "expected"),
    [
        ("/tf /tf_static", "", "/tf"),
        ("/robot1/tf /robot1/tf_static", "", "/robot1/tf"),
        ("/robot1/tf_static", "", "/robot1/tf"),
        ("/robot1/tf /robot2/tf", "/robot2/odom", "/robot2/tf"),
        ("/robot1/tf /robot2/tf /tf", "/odom", "/tf"),
        ("/robot1/tf /tf", "/robot1/odom", "/robot1/tf"),
        ("/robot1/tf /truth", "/truth", "/truth"),
        ("", "/odom", "/tf"),
    ],
)
def test_transforms_are_those_of_the_namespace_of_the_pose(
    recorded: str, pose: str, expected: str
) -> None:
    types = {**({pose: ODOMETRY} if pose else {}), **dict.fromkeys(recorded.split(), TRANSFORMS)}
    found = cast(types, {"pose": pose} if pose else {})
    assert found.transforms == expected
    assert not found.topics.get("pose", "").endswith("_static")


KINDS = pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": CompressionMode.STORAGE},
        {"storage": StoragePlugin.SQLITE3},
    ],
    ids=["mcap", "compressed", "sqlite"],
)


@KINDS
def test_a_drive_is_where_it_was_recorded(tmp_path: Path, options) -> None:
    drive = opened(record_drive(tmp_path / "rosbag2", **options))
    overview = drive.overview()
    assert overview.duration == pytest.approx(19.9, abs=0.01)
    assert overview.started == pytest.approx(START / SECOND)
    assert (overview.remarks, overview.simulated) == ([], False)
    assert overview.topics == {
        "pose": "/odom",
        "scan": "/scan",
        "plan": "/plan",
        "log": "/rosout",
        "tree": "/tree",
    }
    first, second = parts_of(drive)
    times = first.times + second.times
    assert times == pytest.approx([i / 10 for i in range(200)], abs=0.002)
    for i, (x, y) in enumerate(zip(first.x + second.x, first.y + second.y, strict=True)):
        expected = around(i / 10)
        assert (x, y) == pytest.approx((1 + expected[0], expected[1]), abs=0.002)
    assert first.scans[0][1][:2] == [260, 0]  # the laser is 0.1 m ahead of the middle
    assert [len(plan) for _, plan in first.plans + second.plans] == [41, 41]
    happened = [event[1:] for event in first.events + second.events]
    assert happened == [
        ("behavior", "running", "Drive", "RUNNING"),
        ("log", "warn", "planner", "the way is long"),
        ("log", "error", "planner", "collision with the wall"),
        ("behavior", "failure", "Drive", "FAILURE"),
    ]
    assert first.remarks + second.remarks == []
    assert drive.part(1, scans=False).scans == []
    with pytest.raises(InputError, match="no part 2"):
        drive.part(2, scans=True)


@KINDS
def test_what_the_camera_saw_is_shown_at_its_time(tmp_path: Path, options) -> None:
    drive = opened(record_drive(tmp_path / "rosbag2", pictures=True, **options))
    assert drive.overview().topics["camera"] == "/camera/image/compressed"
    first, second = drive.pictures(0), drive.pictures(1)
    frames = first.frames + second.frames
    assert [at for at, _, _ in frames] == pytest.approx([i / 5 for i in range(100)], abs=0.002)
    assert first.content + second.content == [photo(i) for i in range(0, 200, 2)]
    assert [size for _, _, size in frames] == [len(photo(i)) for i in range(0, 200, 2)]
    assert (first.remarks, {kind for _, kind, _ in frames}) == ([], {"image/jpeg"})
    assert opened(record_drive(tmp_path / "blind")).pictures(0).frames == []
    with pytest.raises(InputError, match="no part 2"):
        drive.pictures(2)


def test_few_bytes_that_stand_for_gigabytes_of_pixels_are_left_out(tmp_path: Path) -> None:
    bomb = bytearray(photo(2, "PNG"))
    bomb[16:24] = struct.pack(">II", 60_000, 60_000)
    with DriveBag(tmp_path / "bag") as bag:
        bag.picture(0.0, photo(1), "/sight")
        bag.picture(1.0, bytes(bomb), "/sight")
    found = opened(tmp_path / "bag").pictures(0)
    assert [at for at, *_ in found.frames] == [0.0]
    assert found.remarks == ["/sight has images of more than 34 million pixels, which are skipped."]


def test_pictures_whose_stamps_jump_back_are_shown_in_their_order() -> None:
    clock = Clock((0, 9 * SECOND), (0.0, 9.0), first_stamp=0)
    sent = [
        RecordedMessage(i, "/sight", struct.pack("<4sII", b"\0\1\0\0", second, 0))
        for i, second in enumerate((1, 3, 2, 4))
    ]
    seen = SimpleNamespace(data=np.frombuffer(photo(1), np.uint8))
    found = pictures.read_pictures("/sight", sent, lambda _: seen, clock)
    assert [at for at, *_ in found.frames] == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize("format_", ["JPEG", "PNG", "WEBP"])
@pytest.mark.parametrize(
    "options",
    [{}, {"lossless": True}, {"progressive": True, "optimize": True}, {"exif": Image.Exif()}],
    ids=["plain", "lossless", "progressive", "described"],
)
def test_the_size_of_a_picture_is_that_in_its_file(format_: str, options: dict[str, Any]) -> None:
    file = io.BytesIO()
    mode = "RGBA" if format_ == "WEBP" and "lossless" not in options else "RGB"
    Image.new(mode, (300, 7), (9, 8, 7)).save(file, format_, **options)
    data = file.getvalue()
    assert size_of(data) == (f"image/{format_.lower()}", 300, 7)
    for end in range(20):
        assert size_of(data[:end]) is None
    if format_ == "JPEG":
        assert size_of(data[:2] + b"\xff\xff" + data[2:]) == ("image/jpeg", 300, 7)


def test_what_is_no_picture_is_left_out_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        bag.picture(0.0, photo(1, "PNG"), "/sight")
        bag.picture(0.02, photo(2), "/sight")  # sooner than any screen shows it
        bag.picture(0.5, b"<svg onload=alert(1)>", "/sight")
        bag.write_raw("/sight", PICTURE, b"\0\1\0\0", 0.7)
        bag.picture(1.0, photo(3, "WEBP"), "/sight")
        bag.picture(2.0, photo(4), "/sight")
    found = opened(tmp_path / "bag").pictures(0)
    kinds = [(at, kind) for at, kind, _ in found.frames]
    assert kinds == [(0.0, "image/png"), (1.0, "image/webp"), (2.0, "image/jpeg")]
    assert found.remarks == ["/sight has messages that are not images in JPEG, PNG or WebP."]
    monkeypatch.setattr(pictures, "_MOST_BYTES", sum(map(len, found.content)) - 1)
    less = opened(tmp_path / "bag").pictures(0)
    assert len(less.frames) == 2
    assert "some are skipped after 2 s" in less.remarks[0]


def test_a_camera_that_is_named_wrong_is_said(tmp_path: Path) -> None:
    drive = opened(record_drive(tmp_path / "bag", pictures=True), camera="/scan")
    assert "Without the camera: /scan has messages of type sensor_msgs" in remarks_of(drive)
    assert drive.pictures(0).frames == []


def test_a_simulation_that_is_faster_than_its_recording_has_its_own_time(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        for i in range(100):
            bag.odometry(i / 100, i / 10, 0.0, 0.0, stamp=i / 10 - START / SECOND)
        bag.say(0.5, 40, "half way")  # its stamp is that of the wall clock
    overview = (drive := opened(tmp_path / "bag")).overview()
    assert overview.simulated
    assert overview.duration == pytest.approx(9.9, abs=0.01)
    (part,) = parts_of(drive)
    assert part.times == pytest.approx(part.x, abs=0.002)
    assert part.events[0][0] == pytest.approx(5.0, abs=0.05)


def test_what_happens_at_once_is_told_in_the_order_of_the_recording(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        bag.behave(0.0, Plan=2, Drive=1)
        bag.behave(1.0, Plan=3, Drive=2)
    (part,) = parts_of(opened(tmp_path / "bag"))
    assert [(at, event[1:]) for at, *event in part.events] == [
        (0.0, ["running", "Plan", "RUNNING"]),
        (0.0, ["invalid", "Drive", "INVALID"]),
        (1.0, ["success", "Plan", "SUCCESS"]),
        (1.0, ["running", "Drive", "RUNNING"]),
    ]


def test_a_named_topic_goes_before_a_guessed_one(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        bag.odometry(0.0, 1.0, 2.0, 0.0)
        bag.odometry(1.0, 1.0, 2.0, 0.0)
        estimate = bag.make(
            "geometry_msgs/msg/PoseStamped", bag.header(0.5, "map"), bag.pose(7.0, 8.0, 0.0)
        )
        bag.write("/truth", estimate, 0.5)
    guessed, named = opened(tmp_path / "bag"), opened(tmp_path / "bag", pose="truth")
    assert parts_of(guessed)[0].x == [1.0, 1.0]
    assert parts_of(named)[0].x == [7.0]


def test_transforms_alone_tell_where_the_robot_is(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        bag.transforms([bag.transform("map", "odom", 0.0, (0.0, 3.0, 0.0))], static=True)
        bag.transforms(bag.transform("odom", "base_link", i / 10, (i / 10, 0, 0)) for i in range(9))
    (part,) = parts_of(opened(tmp_path / "bag"))
    assert part.x == pytest.approx([i / 10 for i in range(9)])
    assert set(part.y) == {3.0}


def test_what_is_named_wrong_is_said_and_the_rest_is_shown(tmp_path: Path) -> None:
    bag = record_drive(tmp_path / "bag", 2.0)
    missing = opened(bag, scan="/laser")
    assert "names /laser, which was not recorded. Recorded were /odom, /plan" in remarks_of(missing)
    assert len(parts_of(missing)[0].times) == 20
    other = opened(bag, pose="/scan")
    assert "sensor_msgs/msg/LaserScan; the player reads nav_msgs/msg/Odometry" in remarks_of(other)
    assert len(parts_of(other)[0].scans) == 20


def test_a_usual_topic_of_another_type_is_said(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        bag.odometry(0.0, 0.0, 0.0, 0.0)
        bag.write_raw("/scan", "sensor_msgs/msg/PointCloud2", b"", 1.0)
    drive = opened(tmp_path / "bag")
    assert "/scan has messages of type sensor_msgs/msg/PointCloud2; the play" in remarks_of(drive)


def test_a_bag_without_any_known_topic_says_what_it_has(tmp_path: Path) -> None:
    with Bag(tmp_path / "bag") as bag:
        bag.write("/chatter", bag.make("std_msgs/msg/String", "x"), 0.0)
        bag.write("/chatter", bag.make("std_msgs/msg/String", "x"), 3.0)
    drive = opened(tmp_path / "bag")
    assert "Without the robot's pose: no topic" in remarks_of(drive)
    assert "Recorded were /chatter." in remarks_of(drive)
    assert drive.overview().duration == 3


def test_messages_that_are_not_of_their_type_are_left_out(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        for i in range(20):
            bag.odometry(i / 10, i / 10, 0.0, 0.0)
            bag.write_raw("/odom", "nav_msgs/msg/Odometry", b"\0\1\0\0garbage", i / 10 + 0.04)
            bag.write_raw("/scan", "sensor_msgs/msg/LaserScan", b"\0\1\0\0", i / 10)
            bag.write_raw("/tf", "tf2_msgs/msg/TFMessage", b"\0\1\0\0\xff\xff\xff\xff", i / 10)
        bag.odometry(2.0, math.nan, 0.0, 0.0)
    drive = opened(tmp_path / "bag")
    assert parts_of(drive)[0].x == pytest.approx([i / 10 for i in range(20)])
    for topic in ("/odom", "/scan", "/tf"):
        assert f"{topic} has messages that cannot be read" in remarks_of(drive)


@pytest.mark.parametrize("compression", [None, CompressionMode.STORAGE])
def test_a_bag_that_ends_anywhere_is_played_as_far_as_it_goes(
    tmp_path: Path, compression: CompressionMode | None
) -> None:
    folder = record_drive(tmp_path / "bag", 30.0, compression=compression)
    (path,) = folder.glob("*.mcap")
    (folder / "metadata.yaml").unlink()
    content = path.read_bytes()
    end = content.rindex(b"ros2msg") // 2  # within the messages
    for length in (8, 40, end // 3, end):
        path.write_bytes(content[:length])
        if length < 50:
            with pytest.raises(InputError, match="holds no message"):
                opened(folder)
            continue
        drive = opened(folder)
        assert "has no end: its recorder was stopped while writing" in remarks_of(drive)
        assert sum(len(part.times) for part in parts_of(drive)) <= 300


def test_a_damaged_chunk_takes_nothing_else_with_it(tmp_path: Path) -> None:
    folder = record_drive(tmp_path / "bag", 200.0, compression=CompressionMode.STORAGE)
    (path,) = folder.glob("*.mcap")
    before, frame, after = path.read_bytes().rpartition(b"\x28\xb5\x2f\xfd")
    path.write_bytes(before + bytes(len(frame)) + after)
    drive = opened(folder)
    assert "is skipped" in remarks_of(drive)
    assert 500 < sum(len(part.times) for part in parts_of(drive)) < 2000


def test_a_pause_of_years_is_left_out_of_the_time_line(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        for base in (0.0, 90e6):
            for i in range(50):
                bag.odometry(base + i / 10, i / 10, 0.0, 0.0)
    drive = opened(tmp_path / "bag")
    assert drive.overview().duration == pytest.approx(4.9 + 1 + 4.9)
    assert "For 89,999,995 s nothing was recorded; the time line leaves" in remarks_of(drive)
    assert sum(len(part.times) for part in parts_of(drive)) == 100


def test_stamps_that_jump_back_do_not_tell_the_time(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        for i in range(100):
            bag.odometry(i / 10, i / 10, 0.0, 0.0, stamp=(i % 50) * 2 - START / SECOND)
    drive = opened(tmp_path / "bag")
    assert "jump back" in remarks_of(drive)
    assert "at least 2 episodes" in remarks_of(drive)
    assert parts_of(drive)[0].times == pytest.approx([i / 10 for i in range(100)])


@pytest.mark.parametrize("role", ["/odom", "/tf"])
@pytest.mark.parametrize("shift", [0.0, 0.05])
def test_poses_of_an_episode_are_placed_by_its_transforms(
    tmp_path: Path, role: str, shift: float
) -> None:
    """The simulation is reset after 5 s; then odom stands 100 m further on the map."""
    with DriveBag(tmp_path / "bag") as bag:
        for i in range(100):
            at, stamp = i / 10, (i % 50) / 10 + (shift if i >= 50 else 0)
            x = 100.0 if i >= 50 else 0.0
            moved = [bag.transform("map", "odom", stamp, (x, 0.0, 0.0)),
                     bag.transform("odom", "base_link", stamp, (stamp, 0.0, 0.0))]  # fmt: skip
            bag.write("/tf", bag.make("tf2_msgs/msg/TFMessage", moved), at)
            if role == "/odom":
                bag.odometry(at, stamp, 0.0, 0.0, stamp=stamp)
    drive = opened(tmp_path / "bag")
    assert "this part has 2 episodes" in remarks_of(drive)
    (part,) = parts_of(drive)
    assert part.times == pytest.approx([i / 10 for i in range(100)])
    assert part.x == pytest.approx(
        [i / 10 if i < 50 else 100 + (i - 50) / 10 + shift for i in range(100)]
    )


@pytest.mark.parametrize("jumped", [range(100, 200), range(99, 101), range(199, 200), range(1)])
def test_stamps_that_jump_ahead_do_not_tell_the_time(tmp_path: Path, jumped: range) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        for i in range(200):
            bag.odometry(i / 10, i / 10, 0.0, 0.0, stamp=i / 10 + (1e6 if i in jumped else 0))
    drive = opened(tmp_path / "bag")
    assert drive.overview().duration == pytest.approx(19.9)
    times = [time for part in parts_of(drive) for time in part.times]
    assert times == pytest.approx([i / 10 for i in range(200)])
    assert sum(len(part.times) for part in parts_of(drive)) == 200


def test_a_laser_without_a_mount_is_shown_in_the_middle(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        bag.odometry(0.0, 0.0, 0.0, 0.0)
        bag.odometry(1.0, 0.0, 0.0, 0.0)
        bag.scan(0.5, [1.0, math.inf, math.nan, 20.0], frame="unknown")
    drive = opened(tmp_path / "bag")
    assert parts_of(drive)[0].scans == [(0.5, [100, 0])]
    assert "The position of the laser of /scan on the robot is unknown" in remarks_of(drive)
    assert "No transform leads from the poses' frame to `map`" in remarks_of(drive)


def test_the_recorded_map_is_shown(tmp_path: Path) -> None:
    with DriveBag(tmp_path / "bag") as bag:
        bag.map([[0, 0, 100], [-1, 0, 100]])
    ground = opened(tmp_path / "bag").ground()
    assert ground is not None
    assert (ground.columns, ground.rows, ground.resolution) == (3, 2, 0.5)
    assert ground.runs == [2, 0, 1, 2, 1, 1, 1, 0, 1, 2]


def spoil_nothing(_: Path) -> None:
    pass


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: (f / "bag.mcap").write_bytes(b"text"), "is not an MCAP file"),
        (lambda f: (f / "bag.db3").write_bytes(b"text" * 100), "cannot be read"),
        (lambda f: (f / "bag.mcap.zstd").write_bytes(b"x"), "zstd -d bag.mcap.zstd"),
        (spoil_nothing, "holds no message"),
    ],
)
def test_what_is_no_bag_is_an_error_in_words(
    tmp_path: Path, spoil: Callable[[Path], object], message: str
) -> None:
    (tmp_path / "bag").mkdir()
    spoil(tmp_path / "bag")
    with pytest.raises(InputError, match=message):
        opened(tmp_path / "bag")


def test_zeros_after_the_messages_are_said(tmp_path: Path) -> None:
    folder = record_drive(tmp_path / "bag", 30.0)
    (path,) = folder.glob("*.mcap")
    os.truncate(path, path.stat().st_size // 2)
    os.truncate(path, 300 << 30)
    assert "is damaged at byte" in remarks_of(opened(folder))


def test_records_without_end_are_read_no_further(tmp_path: Path) -> None:
    folder = record_drive(tmp_path / "bag", 2.0)
    empty = struct.pack("<BQQQQIIQ", 6, 40, 1, 2, 0, 0, 0, 0)
    (path,) = folder.glob("*.mcap")
    magic, content = path.read_bytes()[:8], path.read_bytes()[8:]
    path.write_bytes(magic + empty * 250_000 + content)
    with pytest.raises(InputError, match="too many records"):
        opened(folder)


@pytest.mark.parametrize("number", ["abc", None, b"x"])
def test_a_topic_without_a_number_is_left_out(tmp_path: Path, number: object) -> None:
    folder = record_drive(tmp_path / "bag", 2.0, storage=StoragePlugin.SQLITE3)
    (path,) = folder.glob("*.db3")
    with closing(sqlite3.connect(path)) as database, database:
        rows = database.execute(
            "SELECT id, name, type, serialization_format FROM topics"
        ).fetchall()
        database.execute("DROP TABLE topics")
        database.execute("CREATE TABLE topics (id, name, type, serialization_format)")
        rows.append((number, "/odd", "std_msgs/msg/String", "cdr"))
        database.executemany("INSERT INTO topics VALUES (?, ?, ?, ?)", rows)
    assert len(parts_of(opened(folder))[0].times) == 20


def test_a_bag_that_takes_long_holds_no_other_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, quick = record_drive(tmp_path / "slow", 2.0), record_drive(tmp_path / "quick", 2.0)
    begun, end = Event(), Event()

    def read(root: Path, bag: str) -> Recording:
        if bag == slow.name:
            begun.set()
            assert end.wait(PATIENCE)
        return Recording(root, bag)

    monkeypatch.setattr("robovast.evaluation.drive.drives.Recording", read)
    monkeypatch.setattr("robovast.evaluation.drive.drives._PATIENCE", 0.1)
    kept = Drives(tmp_path.resolve())
    with ThreadPoolExecutor() as pool:
        try:
            first = pool.submit(kept.drive, slow.name, {})
            assert begun.wait(PATIENCE)
            assert pool.submit(kept.drive, quick.name, {}).result(PATIENCE)
            with pytest.raises(InputError, match="still being searched"):
                pool.submit(kept.drive, slow.name, {}).result(PATIENCE)
        finally:
            end.set()
        assert first.result(PATIENCE)


@pytest.mark.parametrize("topic", ["/rosout", "/tf_static", "/tf"])
def test_messages_that_memory_cannot_hold_are_left_out_and_said(
    tmp_path: Path, topic: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_module, "_MOST_HELD", 1 << 20)
    with DriveBag(tmp_path / "rosbag2", compression=CompressionMode.STORAGE) as bag:
        for n in range(20):
            at = n / 10
            bag.odometry(at, *around(at))
            if topic == "/rosout":
                bag.say(at, 20, "a" * 100_000)
            else:
                moved = [bag.transform("map", "a" * 100_000, at, (0.0, 0.0, 0.0))]
                bag.write(topic, bag.make("tf2_msgs/msg/TFMessage", moved), at)
    drive = opened(tmp_path / "rosbag2")
    assert f"The messages near one message on {topic} take more than 1 MiB" in remarks_of(drive)
