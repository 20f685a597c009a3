"""Where the meaning of a message comes from when its bag does not say it."""

import sqlite3
import time
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from support.campaigns.bags import START, Bag, convert_alone, rows

from robovast.analysis.bags.definitions import Definition, DefinitionError, typestore_of
from robovast.model.document.commands import RosoutToCsv, TopicsToCsv

PAYLOAD = b"\x00\x01\x00\x00" + (7).to_bytes(4, "little")
"""A message that is one int32."""


def record(
    folder: Path, type_: str, encoding: str, text: str, payload: bytes = PAYLOAD, name: str = "/a"
) -> Path:
    folder.mkdir()
    with (folder / "rosbag2_0.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(type_, encoding, text.encode())
        channel = writer.register_channel(name, "cdr", schema)
        writer.add_message(channel, START, payload, START)
        writer.finish()
    return folder


def convert(bag: Path, definitions: Path | None = None) -> list[str]:
    job = TopicsToCsv(topics=["/a"])
    warnings = convert_alone(bag, job, definitions).warnings
    return [text for text in warnings if "metadata.yaml" not in text and "no message" not in text]


def data(bag: Path, column: str) -> list[str]:
    return [row[column] for row in rows(bag.parent / "rosbag2_a.csv")]


@pytest.mark.parametrize("first", [f"{'=' * 80}\nIDL: my_msgs/msg/Outer\n", ""])
def test_definitions_in_idl_are_read(tmp_path: Path, first: str) -> None:
    outer = "module my_msgs { module msg { struct Outer { my_msgs::msg::Number inner; }; }; };"
    inner = "module my_msgs { module msg { struct Number { int32 value; }; }; };"
    idl = f"{first}{outer}\n{'=' * 80}\nIDL: my_msgs/msg/Number\n{inner}\n"
    bag = record(tmp_path / "rosbag2", "my_msgs/msg/Outer", "ros2idl", idl)
    assert convert(bag) == []
    assert data(bag, "inner.value") == ["7"]


def test_a_type_of_ros_needs_no_definition(tmp_path: Path) -> None:
    bag = record(tmp_path / "rosbag2", "std_msgs/msg/Int32", "", "")
    assert convert(bag) == []
    assert data(bag, "data") == ["7"]


def test_the_definition_of_another_type_may_lie_beside_the_vast_file(tmp_path: Path) -> None:
    bag = record(tmp_path / "rosbag2", "my_msgs/msg/Number", "", "")
    (warning,) = convert(bag, tmp_path)
    assert warning.startswith("/a is skipped: neither the bag nor ROS 2 defines")
    assert "my_msgs/msg/Number.msg" in warning

    file = tmp_path / "files" / "my_msgs" / "msg" / "Number.msg"
    file.parent.mkdir(parents=True)
    file.write_text("int32 found\n")
    other = tmp_path / "files"
    assert convert(bag, other) == []
    assert data(bag, "found") == ["7"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("int32[ a", "is wrong"),
        ("other_msgs/Thing thing", "other_msgs/msg/Thing.msg"),
    ],
)
def test_a_definition_that_cannot_be_used_is_stated(tmp_path: Path, text: str, said: str) -> None:
    bag = record(tmp_path / "rosbag2", "my_msgs/msg/Odd", "ros2msg", text)
    (warning,) = convert(bag)
    assert warning.startswith("/a is skipped: ")
    assert said in warning


@pytest.mark.parametrize("text", ["int32[ a\n" * 500, "int32 x\n---\n---\nint32 y\n"])
def test_a_definition_that_cannot_be_read_is_one_short_line(tmp_path: Path, text: str) -> None:
    bag = record(tmp_path / "rosbag2", "my_msgs/msg/Odd", "ros2msg", text)
    (warning,) = convert(bag)
    assert "\n" not in warning
    assert len(warning) < 250


@pytest.mark.parametrize("end", ["\r\n", "\r", "\n"])
@pytest.mark.parametrize("start", ["", "\ufeff", "# comment — "])
def test_line_ends_and_byte_order_marks_do_not_matter(tmp_path: Path, start: str, end: str) -> None:
    lines = [f"{start}# first", "other_msgs/Part part", "=" * 80, "MSG: other_msgs/Part"]
    text = end.join([*lines, "int32 data"])
    assert convert(record(tmp_path / "rosbag2", "my_msgs/msg/Odd", "ros2msg", text)) == []
    assert data(tmp_path / "rosbag2", "part.data") == ["7"]


def wide(text: str, order: str) -> bytes:
    """Text as Fast DDS and Cyclone DDS store it: the number of 16-bit units, and the units."""
    units = text.encode(f"utf-16-{order}e")
    return (len(units) // 2).to_bytes(4, "little" if order == "l" else "big") + units


@pytest.mark.parametrize("order", ["l", "b"])
@pytest.mark.parametrize("text", ["", "a", "Zürich", "東京", "🤖", "a,b\n"])
@pytest.mark.parametrize(
    "definition", ["wstring text", 'wstring<=9 text\nwstring NAME="x"', "wstring[1] text"]
)
def test_wide_text_is_read(tmp_path: Path, order: str, text: str, definition: str) -> None:
    head = b"\0\1\0\0" if order == "l" else b"\0\0\0\0"
    content = head + wide(text, order)
    bag = record(tmp_path / "rosbag2", "my_msgs/msg/W", "ros2msg", definition, content)
    assert convert(bag) == []
    name = "text[0]" if "[" in definition else "text"
    assert data(bag, name) == [text]


def test_messages_that_are_not_cdr_are_stated(tmp_path: Path) -> None:
    (tmp_path / "rosbag2").mkdir()
    with (tmp_path / "rosbag2" / "rosbag2_0.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/Int32", "ros2msg", b"int32 data")
        channel = writer.register_channel("/a", "json", schema)
        writer.add_message(channel, START, b"{}", START)
        writer.finish()
    (warning,) = convert(tmp_path / "rosbag2")
    assert "json, not cdr" in warning


def test_bags_of_humble_have_no_definitions(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2", storage=StoragePlugin.SQLITE3) as bag:
        bag.write("/a", bag.make("std_msgs/msg/String", "old"))
    (file,) = bag.folder.glob("*.db3")
    database = sqlite3.connect(file)
    database.execute("DROP TABLE message_definitions")
    database.commit()
    database.close()
    assert convert(bag.folder) == []
    assert data(bag.folder, "data") == ["old"]


@pytest.mark.parametrize("type_", ["m/msg/T", "rcl_interfaces/msg/Log"])
def test_a_log_of_another_form_is_left_out(tmp_path: Path, type_: str) -> None:
    folder = record(tmp_path / "rosbag2", type_, "ros2msg", "int32 x\n", name="/rosout")
    warnings = convert_alone(folder, RosoutToCsv()).warnings
    assert any("/rosout" in text and "skipped" in text and type_ in text for text in warnings)


def idl(struct: str, before: str = "") -> str:
    return f"module m {{ module msg {{ {before} struct T {{ {struct} }}; }}; }};"


NESTED = "\n".join(
    ["m/A0 a"]
    + [f"{'=' * 80}\nMSG: m/A{n}\n" + f"m/A{n + 1} a\nm/A{n + 1} b\n" * 5 for n in range(9)]
    + [f"{'=' * 80}\nMSG: m/A9\nint32 x\n"]
)
CHAIN = "\n".join(
    ["m/A0 a"]
    + [f"{'=' * 80}\nMSG: m/A{n}\nm/A{n + 1} a\n" for n in range(2000)]
    + [f"{'=' * 80}\nMSG: m/A2000\nint32 x\n"]
)
EMPTY = f"m/E[60000] a\n{'=' * 80}\nMSG: m/E\nm/F[60000] b\n{'=' * 80}\nMSG: m/F\n"


@pytest.mark.parametrize(
    ("type_", "encoding", "text", "cause"),
    [
        (
            "m/msg/T",
            "ros2idl",
            idl("long x;", f"const long A = {'(' * 40}1{')' * 40};"),
            "expressi",
        ),
        ("m/msg/T", "ros2idl", idl("long x;", "const long A = 1 << 99999999999;"), "expression"),
        ("m/msg/T", "ros2idl", idl("long x[" + "(" * 40 + "1" + ")" * 40 + "];"), "expression"),
        ("m/msg/T", "ros2idl", idl("long x;", "/*" * 100_000), ""),
        ("m/msg/T", "ros2msg", "m/T a\n", "levels deep"),
        ("m/msg/T", "ros2msg", f"m/U a\n{'=' * 80}\nMSG: m/U\nm/T[] b\n", "levels deep"),
        ("m/msg/T", "ros2msg", CHAIN, "levels deep"),
        ("m/msg/T", "ros2msg", NESTED, "fields"),
        ("m/msg/T", "ros2msg", "string[200000] a\n", "more than 65,536 items"),
        ("m/msg/T", "ros2msg", EMPTY, "values in fixed arrays"),
        ("m/msg/T", "ros2msg", "int32 x\n" + "#" * 300_000, "more than 262,144 characters"),
        ("9a/msg/Log", "ros2msg", "int32 x\n", "not the name of a type"),
        ("/etc/msg/X", "", "", "not the name of a type"),
        ("m/msg/T", "ros2msg", "int32 X=1e999\nint32 x\n", None),
        ("m/msg/T", "ros2msg", "float32 X=1e999\nint32 x\n", None),
    ],
)
def test_hostile_definitions_cost_their_topic_alone(
    tmp_path: Path, type_: str, encoding: str, text: str, cause: str | None
) -> None:
    begun = time.process_time()
    warnings = convert(record(tmp_path / "rosbag2", type_, encoding, text), tmp_path)
    assert time.process_time() - begun < 10
    if cause is None:
        assert data(tmp_path / "rosbag2", "x") == ["7"]
    else:
        (warning,) = warnings
        assert warning.startswith("/a is skipped: the definition of ")
        assert cause in warning


WORDS = st.sampled_from(
    [
        *("int32 x", "m/T", "m/U[] u", "[3]", "[<=9]", "string<=5 s", "=", "=1", "(", "\n"),
        *("\n" + "=" * 80, "\nMSG: m/U\n", "struct", "module m {", "};", "const long A = "),
        *("@key", "<", ">", "wstring"),
    ]
)


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(["ros2msg", "ros2idl"]), st.lists(WORDS, max_size=12).map(" ".join))
def test_any_definition_is_read_or_refused(encoding: str, text: str) -> None:
    with suppress(DefinitionError):
        types = typestore_of(Definition("m/msg/T", encoding, text), None, "jazzy").fielddefs
        assert "m/msg/T" in types
