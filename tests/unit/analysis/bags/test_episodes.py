"""A jump back in time begins a new episode, and nothing is interpolated across it."""

import csv
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.campaigns.bags import SECOND, START, Bag, convert_alone, typestore

from robovast.analysis.bags.transforms import Transforms
from robovast.analysis.episodes import episode_starts
from robovast.model.document.commands import TfToCsv

STORE = typestore()


def message(parent: str, child: str, stamp: float, x: float) -> bytes:
    make = STORE.types
    time = make["builtin_interfaces/msg/Time"](*divmod(round(stamp * SECOND), SECOND))
    transform = make["geometry_msgs/msg/TransformStamped"](
        make["std_msgs/msg/Header"](time, parent),
        child,
        make["geometry_msgs/msg/Transform"](
            make["geometry_msgs/msg/Vector3"](x, 0.0, 0.0),
            make["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        ),
    )
    type_ = "tf2_msgs/msg/TFMessage"
    return bytes(STORE.serialize_cdr(make[type_]([transform]), type_))


def found(transforms: Transforms, frame: str = "base_link") -> list[list[float]]:
    """The x of a frame in `map` at its stamps, by episode."""
    episodes = []
    for tree in transforms.trees:
        poses = tree.poses(frame, "map", tree.stamps(frame)[0])
        episodes.append(poses.position[poses.valid, 0].round(6).tolist())
    return episodes


def record(
    episodes: list[list[float]], transforms: Transforms, *, received: bool = True
) -> list[list[float]]:
    """Record episodes, in each of which odom stands 1000 m further; return the expected x."""
    at = START
    for number, stamps in enumerate(episodes):
        for stamp in stamps:
            at += SECOND // 10 if received else 0
            transforms.add(message("map", "odom", stamp, 1000.0 * number), False, at)
            transforms.add(message("odom", "base_link", stamp, stamp), False, at)
        at += SECOND * 5 if received else 0
    return [[round(1000 * n + stamp, 6) for stamp in e] for n, e in enumerate(episodes)]


@given(
    st.lists(
        st.tuples(st.integers(4, 40), st.integers(0, 9)),
        min_size=1,
        max_size=5,
    ),
    st.booleans(),
)
def test_every_episode_keeps_all_of_its_poses(plan: list[tuple[int, int]], received: bool) -> None:
    """Whether stamps repeat exactly or lie between those of other episodes."""
    transforms = Transforms()
    more = 0 if received else 3  # stamps alone cannot distinguish a few late messages
    episodes = [[(k + shift / 10) * 0.5 for k in range(count + more)] for count, shift in plan]
    expected = record(episodes, transforms, received=received)
    assert found(transforms) == expected


@given(st.lists(st.integers(-4, 4), min_size=20, max_size=60), st.booleans())
def test_small_differences_in_order_are_no_episodes(late: list[int], received: bool) -> None:
    """Stamps of a frame that is published every 0.1 s, up to 0.4 s early or late."""
    stamps = np.array([k * 100 + by * 50 for k, by in enumerate(late)], dtype=np.int64) * 1_000_000
    times = np.arange(len(late)) * 100_000_000 if received else np.zeros(len(late), dtype=np.int64)
    assert episode_starts(stamps, times) == []


@given(st.integers(1, 30), st.integers(1, 8), st.booleans(), st.integers(0, 20))
def test_two_publishers_of_a_frame_are_no_episodes(
    lag: int, each: int, received: bool, lost: int
) -> None:
    """One publishes every 0.1 s and is up to 3 s behind the other, which publishes less often.

    The recording ends anywhere.
    """
    each = min(each, lag)  # otherwise the late one catches up without a leap, as after a reset
    both = [
        (now, stamp)
        for now in range(lag, 200)
        for stamp in ([now] if now % each == 0 else []) + [now - lag]
    ]
    both = both[: len(both) - lost]
    stamps = np.array([stamp for _, stamp in both], dtype=np.int64) * 100_000_000
    times = np.array([now for now, _ in both], dtype=np.int64) * 100_000_000
    assert episode_starts(stamps, times if received else times * 0) == []


@given(st.integers(12, 60), st.floats(0, 1), st.integers(1, 40), st.booleans())
def test_the_end_of_a_recording_is_a_reset_only_if_it_is_clear(
    count: int, share: float, rest: int, received: bool
) -> None:
    """A stamp every 0.1 s, then a jump back to any of them, after which the recording ends."""
    back = round(share * (count - 7))
    steps = [*range(count), *range(back, back + min(rest, count - back))]
    stamps = np.array(steps, dtype=np.int64) * 100_000_000
    times = np.arange(len(steps)) * 100_000_000 * received
    clear = rest > 1 or back == 0
    assert episode_starts(stamps, times) == ([count] if clear else [])


def test_fixed_transforms_survive_a_reset_until_they_are_replaced() -> None:
    transforms = Transforms()
    transforms.add(message("base_link", "laser", 0, 0.5), True, START)
    transforms.add(message("map", "odom", 0, 10.0), True, START)
    record_base = [(0.0, 1), (1.0, 2), (2.0, 3), (0.0, 5), (1.0, 6), (2.0, 7)]
    for stamp, at in record_base:
        if at == 5:  # published by the reset simulation, ahead of its first moving transform
            transforms.add(message("map", "odom", 0, 20.0), True, START + 4 * SECOND)
        transforms.add(message("odom", "base_link", stamp, stamp), False, START + at * SECOND)
    assert found(transforms, "laser") == [[10.5, 11.5, 12.5], [20.5, 21.5, 22.5]]


def test_frames_that_are_published_once_per_episode_or_late_stay_in_theirs() -> None:
    transforms = Transforms()
    rows = [
        ("map", "odom", 0, 10.0),
        *(("odom", "base_link", float(t), 0.0) for t in range(4)),
        ("map", "odom", 3.0, 13.0),  # received late
        ("odom", "base_link", 0.0, 0.0),
        ("map", "odom", 3.0, 13.5),  # received after the reset
        ("map", "odom", 0.0, 20.0),
        *(("odom", "base_link", float(t), 0.0) for t in range(1, 4)),
        ("map", "odom", 3.0, 23.0),
    ]
    for number, row in enumerate(rows):
        transforms.add(message(*row), False, START + number * SECOND // 10)
    assert found(transforms) == [[10.0, 11.0, 12.0, 13.0], [20.0, 21.0, 22.0, 23.0]]


def test_a_frame_without_a_jump_of_its_own_is_divided_like_the_others() -> None:
    transforms = Transforms()
    for number, (parent, child, stamp, x) in enumerate(
        [
            ("map", "odom", 0.0, 10.0),
            *(("odom", "base_link", t, 0.0) for t in (0.0, 1.0, 2.0)),
            ("map", "odom", 0.0, 20.0),  # the same stamp
            *(("odom", "base_link", t, 0.0) for t in (0.0, 1.0, 2.0)),
            ("map", "odom", 2.0, 20.0),
        ]
    ):
        transforms.add(message(parent, child, stamp, x), False, START + number * SECOND)
    assert found(transforms) == [[10.0], [20.0, 20.0, 20.0]]


def test_the_table_numbers_the_episodes_and_a_warning_counts_them(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for number in range(3):
            for step in range(4):
                moved = [
                    bag.transform("map", "odom", step, (100.0 * number, 0.0, 0.0)),
                    bag.transform("odom", "base_link", step + number / 2, (step, 0.0, 0.0)),
                ]
                tf = bag.make("tf2_msgs/msg/TFMessage", moved)
                bag.write("/tf", tf, at=number * 20 + step)
    done = convert_alone(bag.folder, TfToCsv())
    with (tmp_path / "poses.csv").open() as file:
        rows = [(row["episode"], float(row["position.x"])) for row in csv.DictReader(file)]
    assert [x for episode, x in rows if episode == "1"] == [0.0, 1.0, 2.0, 3.0]
    assert [x for episode, x in rows if episode == "2"] == [100.0, 101.0, 102.0]
    assert {episode for episode, _ in rows} == {"1", "2", "3"}
    assert [text for text in done.warnings if text.startswith("rosbag2 has 3 episodes: ")]


def test_a_topic_and_a_root_frame_are_chosen_by_parameters(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for robot in (1, 2):
            for step in range(3):
                moved = [bag.transform("odom", "base_link", step, (10.0 * robot + step, 0.0, 0.0))]
                bag.write(f"/robot{robot}/tf", bag.make("tf2_msgs/msg/TFMessage", moved), step)
            fixed = [bag.transform("base_link", "laser", 0, (0.5, 0.0, 0.0))]
            bag.write(f"/robot{robot}/tf_static", bag.make("tf2_msgs/msg/TFMessage", fixed), 0)
    for topic in ("/robot2/tf", "robot2/tf"):
        job = TfToCsv(frames=("laser",), tf_topic=topic, root_frame="/odom")
        assert convert_alone(bag.folder, job).warnings == []
        with (tmp_path / "poses.csv").open() as file:
            assert [float(row["position.x"]) for row in csv.DictReader(file)] == [20.5, 21.5, 22.5]


def test_a_report_names_the_topics_and_frames_that_exist(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.write(
            "/robot1/tf",
            bag.make("tf2_msgs/msg/TFMessage", [bag.transform("odom", "base_link", 0)]),
        )
    (nothing,) = convert_alone(bag.folder, TfToCsv()).warnings
    assert "no transform on /tf" in nothing
    assert "/robot1/tf. Set `tf_topic`" in nothing
    (unknown,) = convert_alone(bag.folder, TfToCsv(tf_topic="/robot1/tf")).warnings
    assert unknown.startswith("rosbag2 has no frame map; it has base_link, odom.")
    assert "`root_frame`" in unknown


def test_more_resets_and_frames_than_memory_holds_are_refused(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        frames = [bag.transform("map", f"fixed{n}", 0, (1.0, 0.0, 0.0)) for n in range(1200)]
        bag.transforms(frames, static=True)
        for n in range(500):
            moved = bag.transform("map", "base_link", 10.0 * (n % 2), (1.0, 0.0, 0.0))
            bag.write("/tf", bag.make("tf2_msgs/msg/TFMessage", [moved]), float(n))
    done = convert_alone(bag.folder, TfToCsv())
    (cause,) = done.failures.values()
    assert cause == (
        "the stamps of its transforms jump back 249 times, which is too often for 1201 frames and "
        "1,700 transforms. "
        "Record the bag again with a steady clock."
    )
    assert not (tmp_path / "poses.csv").exists()
