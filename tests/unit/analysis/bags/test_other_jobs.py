"""Behaviours, actions, log messages and images, each in its own form."""

import io
from pathlib import Path
from typing import Any
from uuid import UUID

import av
import numpy as np
import pytest
from support.campaigns.bags import (
    FEEDBACK,
    FEEDBACK_TYPE,
    START,
    TREE,
    TREE_TYPE,
    Bag,
    convert_alone,
    rows,
    typestore,
)

from robovast.base.errors import InputError
from robovast.model.document.commands import bag_command


def convert(bag: Path, command: str, **parameters: Any) -> list[str]:
    return convert_alone(bag, bag_command(command, parameters)).warnings


def columns(path: Path, *names: str) -> list[tuple[str, ...]]:
    return [tuple(row[name] for name in names) for row in rows(path)]


# Behaviour trees


def test_only_changes_of_a_behaviour_are_rows(tmp_path: Path) -> None:
    store = typestore(**{TREE_TYPE.replace("/", "__"): TREE})
    with Bag(tmp_path / "rosbag2", store) as bag:

        def tree(at: float, *status: int) -> None:
            behaviours = [
                bag.make(
                    "py_trees_ros_interfaces/msg/Behaviour",
                    'drive "home", now',
                    "py_trees.Drive",
                    bag.make("unique_identifier_msgs/msg/UUID", np.full(16, index, np.uint8)),
                    1,
                    value,
                    "",
                )
                for index, value in enumerate(status)
            ]
            bag.write("/tree/snapshots", bag.make(TREE_TYPE, behaviours), at)

        tree(0, 1, 2)
        tree(1, 2, 2)
        tree(2, 2, 2)
        tree(3, 3, 4)
    assert convert(bag.folder, "rosbags_bt_to_csv") == []

    path = tmp_path / "behaviors.csv"
    assert path.read_text().splitlines()[0] == (
        "timestamp,behavior_name,behavior_id,status,status_name,class_name"
    )
    times = [float(time) - START / 1e9 for (time,) in columns(path, "timestamp")]
    assert times == [0, 0, 1, 3, 3]
    assert columns(path, "behavior_id", "status", "status_name") == [
        (str(UUID(int=0)), "1", "INVALID"),
        (str(UUID(bytes=b"\1" * 16)), "2", "RUNNING"),
        (str(UUID(int=0)), "2", "RUNNING"),
        (str(UUID(int=0)), "3", "SUCCESS"),
        (str(UUID(bytes=b"\1" * 16)), "4", "FAILURE"),
    ]
    assert set(columns(path, "behavior_name", "class_name")) == {
        ('drive "home", now', "py_trees.Drive")
    }


# Actions


def feedback(bag: Bag, distance: float) -> Any:
    make = bag.make
    pose = make(
        "geometry_msgs/msg/Pose",
        make("geometry_msgs/msg/Point", 1.0, 2.0, 3.0),
        make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
    )
    duration = make("builtin_interfaces/msg/Duration", 4, 5)
    return make(
        FEEDBACK_TYPE,
        make("unique_identifier_msgs/msg/UUID", np.arange(16, dtype=np.uint8)),
        make(
            "nav2_msgs/msg/NavigateToPose_Feedback",
            make("geometry_msgs/msg/PoseStamped", bag.header(0, "map"), pose),
            duration,
            duration,
            2,
            distance,
        ),
    )


def record_action(folder: Path, action: str, type_: str = FEEDBACK_TYPE) -> None:
    store = typestore(**{FEEDBACK_TYPE.replace("/", "__"): FEEDBACK})
    with Bag(folder, store) as bag:
        for number in range(2):
            data = bag.store.serialize_cdr(feedback(bag, 7.5 - number), FEEDBACK_TYPE)
            bag.write_raw(f"/{action}/_action/feedback", type_, bytes(data), number + 0.25)
        goal = bag.make("action_msgs/msg/GoalStatus", goal_info(bag), 2)
        for goals in ([], [goal], [goal, goal]):
            array = bag.make("action_msgs/msg/GoalStatusArray", goals)
            bag.write(f"/{action}/_action/status", array)


def goal_info(bag: Bag) -> Any:
    uuid = bag.make("unique_identifier_msgs/msg/UUID", np.zeros(16, np.uint8))
    return bag.make("action_msgs/msg/GoalInfo", uuid, bag.header(0, "").stamp)


def test_feedback_and_status_of_an_action_are_two_files(tmp_path: Path) -> None:
    record_action(tmp_path / "rosbag2", "navigate_to_pose")
    assert convert(tmp_path / "rosbag2", "rosbags_action_to_csv", action="navigate_to_pose") == []

    path = tmp_path / "action_navigate_to_pose_feedback.csv"
    assert columns(
        path, "timestamp", "feedback_distance_remaining", "feedback_current_pose_pose_position_y"
    ) == [("1700000000.250000000", "7.5", "2.0"), ("1700000001.250000000", "6.5", "2.0")]
    status = tmp_path / "action_navigate_to_pose_status.csv"
    assert columns(status, "status_list_0_status", "status_list_1_status") == [
        ("", ""),
        ("2", ""),
        ("2", "2"),
    ]


def test_the_names_of_an_actions_files_can_be_chosen(tmp_path: Path) -> None:
    record_action(tmp_path / "rosbag2", "robot/drive")
    convert(tmp_path / "rosbag2", "rosbags_action_to_csv", action="/robot/drive")
    convert(
        tmp_path / "rosbag2", "rosbags_action_to_csv", action="robot/drive", filename_prefix="d"
    )
    found = sorted(path.name for path in tmp_path.glob("*.csv"))
    assert found == [
        "action_robot_drive_feedback.csv",
        "action_robot_drive_status.csv",
        "d_feedback.csv",
        "d_status.csv",
    ]


@pytest.fixture
def undefined_feedback(tmp_path: Path) -> Path:
    """A bag whose recorder has left the type of feedback undefined, as those before Kilted do."""
    record_action(tmp_path / "rosbag2", "a")
    (file,) = (tmp_path / "rosbag2").glob("*.mcap")
    whole = tmp_path / "whole"
    whole.mkdir()
    file.rename(whole / file.name)
    without_definition(whole / file.name, file)
    return tmp_path / "rosbag2"


def without_definition(source: Path, target: Path) -> None:
    from mcap.reader import make_reader
    from mcap.writer import Writer

    with source.open("rb") as stream, target.open("wb") as out:
        writer = Writer(out)
        writer.start()
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            if channel.id not in channels:
                known = "_FeedbackMessage" not in schema.name
                text = schema.data if known else b""
                number = writer.register_schema(schema.name, schema.encoding if known else "", text)
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time
            )
        writer.finish()


def test_feedback_of_nav2_needs_no_definition_in_the_bag(undefined_feedback: Path) -> None:
    assert convert(undefined_feedback, "rosbags_action_to_csv", action="a") == []
    path = undefined_feedback.parent / "action_a_feedback.csv"
    assert columns(path, "feedback_distance_remaining") == [("7.5",), ("6.5",)]


def test_a_definition_beside_the_vast_file_counts_before_a_known_one(
    undefined_feedback: Path, tmp_path: Path
) -> None:
    fields = FEEDBACK.split("_Feedback\n")[-1].replace("distance_remaining", "way_to_go")
    folder = tmp_path / "config" / "interfaces" / "nav2_msgs" / "action"
    folder.mkdir(parents=True)
    (folder / "NavigateToPose.action").write_text(f"---\n---\n{fields}")
    job = bag_command("rosbags_action_to_csv", {"action": "a"})
    convert_alone(undefined_feedback, job, tmp_path / "config")
    assert columns(tmp_path / "action_a_feedback.csv", "feedback_way_to_go") == [
        ("7.5",),
        ("6.5",),
    ]


# Log messages


def record_log(folder: Path) -> None:
    with Bag(folder) as bag:
        for at, level in enumerate([10, 20, 30, 40, 50]):
            stamp = bag.header(at + 0.5, "").stamp
            text = f'level {level}, "quoted"\nsecond line'
            bag.write(
                "/rosout",
                bag.make("rcl_interfaces/msg/Log", stamp, level, "node", text, "a.cpp", "f()", 7),
                at,
            )


def test_every_log_message_is_a_row(tmp_path: Path) -> None:
    record_log(tmp_path / "rosbag2")
    assert convert(tmp_path / "rosbag2", "rosbags_rosout_to_csv") == []
    path = tmp_path / "rosout.csv"
    assert path.read_text().splitlines()[0] == (
        "timestamp,stamp,level,level_name,name,msg,file,function,line"
    )
    assert list(rows(path)[1].values()) == [
        "1700000001.000000000",
        "1700000001.500000000",
        "20",
        "INFO",
        "node",
        'level 20, "quoted"\nsecond line',
        "a.cpp",
        "f()",
        "7",
    ]
    assert len(rows(path)) == 5


@pytest.mark.parametrize(
    ("parameters", "levels"),
    [
        ({"min_level": 30}, ["WARN", "ERROR", "FATAL"]),
        ({"skip_levels": ["ERROR", "fatal"]}, ["DEBUG", "INFO", "WARN"]),
    ],
)
def test_levels_can_be_left_out(
    tmp_path: Path, parameters: dict[str, Any], levels: list[str]
) -> None:
    record_log(tmp_path / "rosbag2")
    convert(tmp_path / "rosbag2", "rosbags_rosout_to_csv", **parameters)
    assert columns(tmp_path / "rosout.csv", "level_name") == [(level,) for level in levels]


# Videos


def encoded(shade: int, codec: str, size: tuple[int, int] = (64, 48)) -> np.ndarray:
    width, height = size
    frame = av.VideoFrame.from_ndarray(np.full((height, width, 3), shade, np.uint8), format="rgb24")
    out = io.BytesIO()
    pixels = {"mjpeg": "yuvj420p", "png": "rgb24"}[codec]
    with av.open(out, "w", format="image2pipe") as container:
        stream = container.add_stream(codec)
        stream.width, stream.height, stream.pix_fmt = width, height, pixels
        if codec == "mjpeg":
            stream.codec_context.color_range = 2
        container.mux(stream.encode(frame.reformat(format=pixels)))
        container.mux(stream.encode(None))
    return np.frombuffer(out.getvalue(), np.uint8)


def frames(path: Path) -> tuple[str, list[float], list[int]]:
    """Codec, times [s] and mean shade of the frames of a video."""
    with av.open(str(path)) as container:
        (stream,) = container.streams
        decoded = list(container.decode(stream))
        shades = [round(float(frame.to_ndarray(format="gray").mean())) for frame in decoded]
        return stream.codec.name, [round(float(frame.time), 3) for frame in decoded], shades


@pytest.mark.parametrize("codec", ["mjpeg", "png"])
def test_compressed_images_are_frames_at_their_stamps(tmp_path: Path, codec: str) -> None:
    topic = "/camera/image_raw/compressed"
    with Bag(tmp_path / "rosbag2") as bag:
        for at, shade in [(5.0, 20), (5.1, 120), (5.5, 220)]:
            image = bag.make(
                "sensor_msgs/msg/CompressedImage",
                bag.header(at, "camera"),
                codec,
                encoded(shade, codec),
            )
            bag.write(topic, image, at + 100)
    assert convert(bag.folder, "rosbags_to_webm") == []
    codec_name, times, shades = frames(tmp_path / "rosbag2_camera_image_raw_compressed.webm")
    assert "vp9" in codec_name
    assert times == [0, 0.1, 0.5]
    assert shades == pytest.approx([20, 120, 220], abs=20)


def test_raw_images_of_odd_size_and_padded_rows_are_frames(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for number, (encoding, channels) in enumerate([("bgr8", 3), ("mono8", 1), ("rgba8", 4)]):
            data = np.full(33 * (65 * channels + 5), 100, np.uint8)
            image = bag.make(
                "sensor_msgs/msg/Image",
                bag.header(number, "camera"),
                33,
                65,
                encoding,
                0,
                65 * channels + 5,
                data,
            )
            bag.write("/image", image, number)
    assert convert(bag.folder, "rosbags_to_webm", topic="/image") == []
    _, times, shades = frames(tmp_path / "rosbag2_image.webm")
    assert times == [0, 1, 2]
    assert shades == pytest.approx([100] * 3, abs=20)


def test_images_whose_stamps_do_not_advance_follow_each_other_at_the_frame_rate(
    tmp_path: Path,
) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for _ in range(3):
            image = bag.make(
                "sensor_msgs/msg/CompressedImage",
                bag.header(1, "camera"),
                "png",
                encoded(50, "png"),
            )
            bag.write("/image", image)
    convert(bag.folder, "rosbags_to_webm", topic="/image", fps=10)
    assert frames(tmp_path / "rosbag2_image.webm")[1] == [0, 0.1, 0.2]


def test_a_video_continues_after_a_simulation_reset(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for received, stamp in enumerate([0, 1, 2, 0, 1, 2]):
            header, data = bag.header(stamp, "camera"), encoded(50, "png")
            image = bag.make("sensor_msgs/msg/CompressedImage", header, "png", data)
            bag.write("/image", image, received)
    convert(bag.folder, "rosbags_to_webm", topic="/image", fps=10)
    assert frames(tmp_path / "rosbag2_image.webm")[1] == [0, 1, 2, 2.1, 3.1, 4.1]


def test_damaged_images_are_left_out_and_without_any_there_is_no_video(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for topic, images in {"/some": [b"junk", None], "/none": [b"\x89PNG", b""]}.items():
            for data in images:
                content = encoded(90, "png") if data is None else np.frombuffer(data, np.uint8)
                image = bag.make(
                    "sensor_msgs/msg/CompressedImage", bag.header(1, ""), "png", content
                )
                bag.write(topic, image)
    (warning,) = convert(bag.folder, "rosbags_to_webm", topic="/some")
    assert warning.startswith("1 messages on /some are skipped")
    assert len(frames(tmp_path / "rosbag2_some.webm")[1]) == 1
    warnings = convert(bag.folder, "rosbags_to_webm", topic="/none")
    assert len(warnings) == 2
    assert not (tmp_path / "rosbag2_none.webm").exists()


# Parameters


@pytest.mark.parametrize(
    ("command", "parameters", "said"),
    [
        ("rosbags_to_csv", {"topics": "/odom"}, "`topics` must be a list, not '/odom'"),
        ("rosbags_to_csv", {"topics": ["/a/b", "/a_b"]}, "`topics` /a/b and /a_b would be written"),
        ("rosbags_to_csv", {"topic": "/x"}, "unknown parameter `topic` (did you mean `topics`?)"),
        ("rosbags_tf_to_csv", {"csv_filename": "../p.csv"}, "`csv_filename` must be a file name"),
        ("rosbags_action_to_csv", {}, "the parameter `action` is missing"),
        ("rosbags_rosout_to_csv", {"min_level": "LOUD"}, "`min_level` must be one of DEBUG, INFO"),
        ("rosbags_rosout_to_csv", {"skip_levels": ["LOUD"]}, "`skip_levels.0` must be 'DEBUG', "),
        ("rosbags_to_webm", {"fps": 0}, "`fps` must be greater than 0, not 0"),
        ("rosbags_bt_to_csv", {"bag_dir": "../x"}, "`bag_dir` must be the path of a folder"),
    ],
)
def test_a_wrong_parameter_is_named(command: str, parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as error:
        bag_command(command, parameters)
    assert str(error.value).startswith(f"{command}: {said}")


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 40), (40, 1), (6000, 6)])
def test_images_that_no_video_can_have_are_left_out(
    tmp_path: Path, width: int, height: int
) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for at, (columns, lines) in enumerate([(width, height), (40, 30)]):
            header, data = bag.header(at, "camera"), np.zeros(columns * lines, np.uint8)
            image = bag.make(
                "sensor_msgs/msg/Image", header, lines, columns, "mono8", 0, columns, data
            )
            bag.write("/image", image, at)
    (warning,) = convert(bag.folder, "rosbags_to_webm", topic="/image")
    assert f"an image has {width} x {height} pixels; videos have 2 to 4096" in warning
    assert len(frames(tmp_path / "rosbag2_image.webm")[1]) == 1
