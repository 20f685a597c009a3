"""Poses in `map` follow from all transforms of a bag, as tf2 would have them."""

import math
from itertools import pairwise
from pathlib import Path

import pytest
from support.campaigns.bags import START, Bag, convert_alone, rows

from robovast.model.document.commands import TfToCsv

QUARTER = math.pi / 2


def poses(bag: Path, *frames: str) -> tuple[list[dict[str, float]], list[str]]:
    """Rows with numbers, times from the start; warnings."""
    job = TfToCsv(frames=frames) if frames else TfToCsv()
    done = convert_alone(bag, job)
    path = bag.parent / "poses.csv"
    table = rows(path) if path.exists() else []
    numbers = [
        {key: value if key == "frame" else float(value) for key, value in row.items()}
        for row in table
    ]
    for row in numbers:
        row["timestamp"] = round(row["timestamp"] - START / 1e9, 6)
    return numbers, done.warnings


def place(row: dict[str, float]) -> tuple[float, ...]:
    return tuple(round(row[f"position.{axis}"], 9) for axis in "xyz")


def test_the_file_has_the_columns_of_the_manual(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms([bag.transform("map", "base_link", 0.5, (1.0, 2.0, 3.0), yaw=0.25)])
    poses(bag.folder)
    head, line = (tmp_path / "poses.csv").read_text().splitlines()
    assert head == (
        "frame,timestamp,position.x,position.y,position.z,"
        "orientation.roll,orientation.pitch,orientation.yaw"
    )
    assert line.startswith("base_link,1700000000.500000000,1.0,2.0,3.0,0.0,0.0,0.25")


def test_a_chain_is_composed_and_what_is_above_is_interpolated(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms(
            [
                bag.transform("map", "odom", 0, (0.0, 0.0, 0.0), yaw=0.0),
                bag.transform("odom", "base_link", 0.5, (1.0, 0.0, 0.0)),
                bag.transform("map", "odom", 1, (10.0, 0.0, 0.0), yaw=QUARTER),
            ]
        )
    (row,), warnings = poses(bag.folder)
    assert warnings == []
    assert row["timestamp"] == 0.5
    half = math.sqrt(0.5)
    assert place(row) == (round(5 + half, 9), round(half, 9), 0.0)
    assert row["orientation.yaw"] == pytest.approx(QUARTER / 2)


def test_a_fixed_frame_has_a_pose_whenever_what_carries_it_has(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms([bag.transform("base_link", "laser", 0, (0.2, 0.0, 0.1))], static=True)
        bag.transforms(
            bag.transform("map", "base_link", at, (at, 0.0, 0.0), yaw=QUARTER) for at in (1, 2, 3)
        )
    table, _ = poses(bag.folder, "laser")
    assert [row["timestamp"] for row in table] == [1.0, 2.0, 3.0]
    assert [place(row) for row in table] == [(at, 0.2, 0.1) for at in (1.0, 2.0, 3.0)]


def test_a_fixed_transform_holds_before_it_was_recorded(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms([bag.transform("odom", "base_link", 1, (1.0, 0.0, 0.0))])
        bag.transforms([bag.transform("map", "odom", 5, (0.0, 1.0, 0.0))], static=True)
    (row,), warnings = poses(bag.folder)
    assert (place(row), warnings) == ((1.0, 1.0, 0.0), [])


def test_nothing_is_extrapolated_and_what_is_left_out_is_counted(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for at in (0.5, 1, 1.5, 2, 2.5):
            if at in (1, 2):
                bag.transforms([bag.transform("map", "odom", at)])
            bag.transforms([bag.transform("odom", "base_link", at)])
    table, (warning,) = poses(bag.folder)
    assert [row["timestamp"] for row in table] == [1.0, 1.5, 2.0]
    assert warning.startswith("2 of 5 poses of base_link in map are skipped")


def test_orientations_turn_the_shorter_way(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms(
            [
                bag.transform("map", "odom", 0, yaw=math.radians(170)),
                bag.transform("map", "odom", 1, yaw=math.radians(-170)),
                bag.transform("odom", "base_link", 0.25),
            ]
        )
    (row,), _ = poses(bag.folder)
    assert math.degrees(row["orientation.yaw"]) == pytest.approx(175)


def test_frames_of_another_branch_are_reached_over_the_common_root(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms([bag.transform("world", "map", 0, (1.0, 0.0, 0.0), yaw=QUARTER)], True)
        bag.transforms([bag.transform("world", "base_link", 0, (1.0, 3.0, 0.0))])
    (row,), warnings = poses(bag.folder)
    assert (place(row), warnings) == ((3.0, 0.0, 0.0), [])
    assert row["orientation.yaw"] == pytest.approx(-QUARTER)


def test_a_frame_may_change_its_parent(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms([bag.transform("map", "hand", 0, (10.0, 0.0, 0.0))], static=True)
        bag.transforms(
            [
                bag.transform("map", "cup", 1, (1.0, 0.0, 0.0)),
                bag.transform("hand", "cup", 2, (0.5, 0.0, 0.0)),
            ]
        )
    table, _ = poses(bag.folder, "cup")
    assert [place(row)[0] for row in table] == [1.0, 10.5]


def test_a_loop_of_frames_ends(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms([bag.transform("a", "base_link", 0), bag.transform("base_link", "a", 0)])
        bag.transforms([bag.transform("map", "other", 0)])
    table, (warning,) = poses(bag.folder)
    assert table == []
    assert warning.startswith("1 of 1 poses of base_link")


def test_a_chain_of_too_many_frames_ends(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        names = ["map", *(f"f{n}" for n in range(1500)), "base_link"]
        bag.transforms(bag.transform(a, b, 0) for a, b in pairwise(names))
    table, (warning,) = poses(bag.folder)
    assert table == []
    assert warning.startswith("1 of 1 poses of base_link")


def test_transforms_that_tf2_would_refuse_are_left_out_and_counted(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bad = [
            bag.transform("map", "base_link", 1, (math.nan, 0.0, 0.0)),
            bag.transform("map", "base_link", 2, (0.0, math.inf, 0.0)),
            bag.transform("base_link", "base_link", 3),
            bag.transform("", "base_link", 4),
            bag.transform("map", "base_link", 5),
            bag.transform("map", "base_link", 6),
        ]
        bad[-2].transform.rotation.w = 0.0
        bad[-1].transform.rotation.w = 1e300  # its square is more than a float holds
        bag.transforms([*bad, bag.transform("/map", "/base_link", 7)])
    table, (warning,) = poses(bag.folder)
    assert [row["timestamp"] for row in table] == [7.0]
    assert warning.startswith("6 transforms are skipped")


def test_of_two_transforms_with_one_stamp_the_first_counts(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms(bag.transform("map", "base_link", 1, (x, 0.0, 0.0)) for x in (1.0, 2.0))
    table, _ = poses(bag.folder)
    assert [place(row)[0] for row in table] == [1.0]


def test_frames_share_a_file_in_the_order_of_time(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms(bag.transform("map", "a", at) for at in (3, 1))
        bag.transforms(bag.transform("map", "b", at) for at in (2, 1))
    table, _ = poses(bag.folder, "b", "a")
    assert [(row["timestamp"], row["frame"]) for row in table] == [
        (1.0, "b"),
        (1.0, "a"),
        (2.0, "b"),
        (3.0, "a"),
    ]


@pytest.mark.parametrize(("frames", "unknown"), [(["nobody"], "nobody"), (["b"], "map")])
def test_an_unknown_frame_is_named_with_those_that_exist(
    tmp_path: Path, frames: list[str], unknown: str
) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.transforms([bag.transform("a" if unknown == "map" else "map", "b", 0)])
    table, (warning,) = poses(bag.folder, *frames)
    assert table == []
    assert warning.startswith(f"rosbag2 has no frame {unknown}; it has ")


def test_big_endian_recordings_give_the_same_poses(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        transform = bag.transform("map", "base_link", 1, (1.0, 2.0, 3.0), yaw=1.0)
        message = bag.make("tf2_msgs/msg/TFMessage", [transform])
        bag.write("/tf", message, little_endian=False)
    (row,), _ = poses(bag.folder)
    assert place(row) == (1.0, 2.0, 3.0)
    assert row["orientation.yaw"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "angles", [(0.1, -0.2, 0.3), (3.0, 1.0, -3.0), (0.0, QUARTER, 0.5), (0.0, -QUARTER, -0.5)]
)
def test_roll_pitch_and_yaw_turn_about_fixed_axes(angles: tuple[float, float, float]) -> None:
    import numpy as np

    from robovast.analysis.bags.transforms import _multiply, euler

    axes = np.eye(3)
    turns = [np.array([[*axes[i] * np.sin(a / 2), np.cos(a / 2)]]) for i, a in enumerate(angles)]
    orientation = _multiply(turns[2], _multiply(turns[1], turns[0]))
    assert euler(orientation)[0] == pytest.approx(angles, abs=1e-7)
