"""Messages of any type become rows, each field a column."""

import math
import re
import struct
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from support.campaigns.bags import SECOND, START, Bag, convert_alone, rows, typestore

from robovast.analysis.bags import table as table_module
from robovast.analysis.bags.table import CsvTable
from robovast.analysis.tables.csv_files import column_names
from robovast.base.errors import InputError
from robovast.model.document.commands import ActionToCsv, TopicsToCsv
from rosbags_common import gen_msg_values

CUSTOM = """\
bool ok
int8 small
float64 exact
string[] names
my_msgs/Item[<=4] items
my_msgs/Item[2] pair
uint8[3] code
bool[] flags
float32 short
int64 big
char letter
string<=20 label
uint64[] huge
my_msgs/Nothing nothing
float64 after
================================================================================
MSG: my_msgs/Item
uint8 kind
float64 value
string text
int16[] steps
================================================================================
MSG: my_msgs/Nothing
"""
TYPE = "my_msgs/msg/Everything"


@pytest.fixture
def everything() -> Callable[..., object]:
    store = typestore(my_msgs__msg__Everything=CUSTOM)
    item, nothing = store.types["my_msgs/msg/Item"], store.types["my_msgs/msg/Nothing"]

    def make(items: int = 1, text: str = "plain") -> object:
        part = [
            item(index, index / 3, text, np.arange(index, dtype=np.int16))
            for index in range(max(items, 2))
        ]
        return store.types[TYPE](
            True,
            -3,
            0.1,
            [text, ""],
            part[:items],
            part[:2],
            np.array([1, 2, 255], dtype=np.uint8),
            np.array([True, False]),
            0.1,
            -(2**62),
            65,
            text,
            np.array([2**64 - 1], dtype=np.uint64),
            nothing(),
            -0.5,
        )

    make.store = store
    return make


def convert(bag: Path, *topics: str) -> list[str]:
    done = convert_alone(bag, TopicsToCsv(topics=topics))
    return done.warnings


def same(text: str, value: object) -> bool:
    if isinstance(value, np.bool_ | bool | str):
        return text == str(value)
    return math.isclose(float(text), float(value), rel_tol=1e-6)


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("little_endian", [True, False])
def test_every_field_of_a_custom_type_is_a_column(
    tmp_path: Path, everything: Callable, storage: StoragePlugin, little_endian: bool
) -> None:
    message = everything(items=3)
    with Bag(tmp_path / "rosbag2", everything.store, storage) as bag:
        bag.write("/all/of/it", message, at=1.5, little_endian=little_endian)

    assert convert(bag.folder, "/all/of/it") == []

    (row,) = rows(tmp_path / "rosbag2_all_of_it.csv")
    assert row.pop("timestamp") == str(START + 1_500_000_000)
    assert row.pop("type") == TYPE
    expected = dict(gen_msg_values(message))
    assert list(row) == sorted(expected)
    assert {name for name, text in row.items() if not same(text, expected[name])} == set()


def test_numbers_are_written_as_short_as_they_are_exact(
    tmp_path: Path, everything: Callable
) -> None:
    with Bag(tmp_path / "rosbag2", everything.store) as bag:
        bag.write("/a", everything())
    convert(bag.folder, "/a")
    (row,) = rows(tmp_path / "rosbag2_a.csv")
    assert (row["exact"], row["short"]) == ("0.1", "0.1")
    assert (row["big"], row["huge[0]"]) == (str(-(2**62)), str(2**64 - 1))


def test_rows_of_different_lengths_share_the_columns_of_all(
    tmp_path: Path, everything: Callable
) -> None:
    with Bag(tmp_path / "rosbag2", everything.store) as bag:
        for number, items in enumerate([1, 3, 0, 1]):
            bag.write("/a", everything(items, 'a "b", \n c'), at=number)
    convert(bag.folder, "/a")
    table = rows(tmp_path / "rosbag2_a.csv")
    assert [row["items[2].kind"] for row in table] == ["", "2", "", ""]
    assert [row["items[0].value"] for row in table] == ["0.0", "0.0", "", "0.0"]
    assert {row["after"] for row in table} == {"-0.5"}
    assert {row["label"] for row in table} == {'a "b", \n c'}
    assert list(table[0])[2:] == sorted(list(table[0])[2:])


@pytest.mark.parametrize(
    "text", ["a,b", 'say "x"', "two\nlines", "carriage\r\nreturn", "ü→🤖", " edges ", "[1]\\n"]
)
def test_text_survives_whatever_is_in_it(tmp_path: Path, text: str) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.write("/a", bag.make("std_msgs/msg/String", text))
    convert(bag.folder, "/a")
    assert rows(tmp_path / "rosbag2_a.csv")[0]["data"] == text


def test_text_that_is_not_utf8_is_still_a_row(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        raw = b"\x00\x01\x00\x00" + (4).to_bytes(4, "little") + b"a\xffb\x00"
        bag.write_raw("/a", "std_msgs/msg/String", raw)
    assert convert(bag.folder, "/a") == []
    assert rows(tmp_path / "rosbag2_a.csv")[0]["data"] == "a\\xffb"


def test_numbers_that_are_not_finite_can_be_read_back(tmp_path: Path) -> None:
    values = np.array([np.nan, np.inf, -np.inf, 1.0], dtype=np.float32)
    with Bag(tmp_path / "rosbag2") as bag:
        scan = bag.make(
            "sensor_msgs/msg/LaserScan", bag.header(0, "laser"), *[np.nan] * 7, values, values[:0]
        )
        bag.write("/scan", scan)
        bag.write("/point", bag.make("geometry_msgs/msg/Point", np.inf, -np.inf, np.nan))
    convert(bag.folder, "/scan", "/point")
    (row,) = rows(tmp_path / "rosbag2_scan.csv")
    ranges = [row[f"ranges[{index}]"] for index in range(4)]
    assert ranges == ["nan", "inf", "-inf", "1.0"]
    (row,) = rows(tmp_path / "rosbag2_point.csv")
    assert [row[axis] for axis in "xyz"] == ["inf", "-inf", "nan"]


def test_a_topic_with_two_types_has_the_columns_of_both(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.write("/a", bag.make("std_msgs/msg/String", "x"))
        bag.write("/a", bag.make("geometry_msgs/msg/Point", 1.0, 2.0, 3.0), at=1)
    convert(bag.folder, "/a")
    table = rows(tmp_path / "rosbag2_a.csv")
    assert [(row["type"], row["data"], row["y"]) for row in table] == [
        ("std_msgs/msg/String", "x", ""),
        ("geometry_msgs/msg/Point", "", "2.0"),
    ]


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_compressed_bags_are_read(
    tmp_path: Path, storage: StoragePlugin, mode: CompressionMode
) -> None:
    with Bag(tmp_path / "rosbag2", storage=storage, compression=mode) as bag:
        for number in range(3):
            bag.write("/a", bag.make("std_msgs/msg/String", f"text {number}"), at=number)
    assert convert(bag.folder, "/a") == []
    table = rows(tmp_path / "rosbag2_a.csv")
    assert [row["data"] for row in table] == ["text 0", "text 1", "text 2"]


def test_a_topic_without_messages_is_stated_and_has_no_table(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        bag.write("/a", bag.make("std_msgs/msg/String", "x"))
    warnings = convert(bag.folder, "/b", "/a")
    assert warnings == ["rosbag2 has no message on /b; it has /a"]
    assert not (tmp_path / "rosbag2_b.csv").exists()
    assert len(rows(tmp_path / "rosbag2_a.csv")) == 1


def test_messages_that_are_none_are_counted_and_left_out(tmp_path: Path) -> None:
    with Bag(tmp_path / "rosbag2") as bag:
        for data in [b"", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + b"\xff" * 20, b"\x09\x09ab"]:
            bag.write_raw("/a", "std_msgs/msg/String", data)
        bag.write("/a", bag.make("std_msgs/msg/String", "x"))
    (warning,) = convert(bag.folder, "/a")
    assert warning.startswith(
        "4 messages on /a are skipped: they are not valid std_msgs/msg/String"
    )
    assert [row["data"] for row in rows(tmp_path / "rosbag2_a.csv")] == ["x"]


def test_a_damaged_length_is_noticed_at_once(tmp_path: Path) -> None:
    text = "my_msgs/Nothing[] nothing\n" + "=" * 80 + "\nMSG: my_msgs/Nothing\n"
    store = typestore(my_msgs__msg__Many=text)
    with Bag(tmp_path / "rosbag2", store) as bag:
        bag.write_raw("/a", "my_msgs/msg/Many", b"\x00\x01\x00\x00" + b"\xff" * 8)
    (warning,) = [text for text in convert(bag.folder, "/a") if "skipped" in text]
    assert warning.endswith("they are not valid my_msgs/msg/Many messages (wrong length)")


@settings(max_examples=25, deadline=None)
@given(
    names=st.lists(
        st.sampled_from(["timestamp", "type", "timestamp_2", "type_2", "a", "run_id", "value"]),
        min_size=1,
        unique=True,
    ),
    shapes=st.booleans(),
)
def test_columns_have_different_names_in_csv_and_sql(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], shapes: bool
) -> None:
    """Whatever the fields are called, and whether or not rows have different columns."""
    tmp_path = tmp_path_factory.mktemp("t")
    text = "".join(f"int32 {name}\n" for name in names) + "int32[] list\n"
    with Bag(tmp_path / "rosbag2", typestore(my_msgs__msg__Own=text)) as bag:
        for count in (0, int(shapes)):
            numbers = [*range(100, 100 + len(names)), count, *range(count)]
            data = b"\0\1\0\0" + struct.pack(f"<{len(numbers)}i", *numbers)
            bag.write_raw("/a", "my_msgs/msg/Own", data)
    assert convert(bag.folder, "/a") == []
    path = tmp_path / "rosbag2_a.csv"
    header = path.read_text().splitlines()[0].split(",")
    assert header[:2] == ["timestamp", "type"]
    assert column_names(header) == header
    first, second = rows(path)
    for number, name in enumerate(names, 100):
        taken = [column for column in header if first[column] == str(number)]
        assert len(taken) == 1
        assert taken[0] == name or re.fullmatch(f"{name}_[0-9]+", taken[0])
        assert second[taken[0]] == str(number)
    assert first["timestamp"] == str(START)
    assert first["type"] == "my_msgs/msg/Own"


@settings(max_examples=25, deadline=None)
@given(st.permutations(["timestamp", "a_b", "a_b_2"]))
def test_columns_of_actions_have_different_names(
    tmp_path_factory: pytest.TempPathFactory, names: list[str]
) -> None:
    tmp_path = tmp_path_factory.mktemp("t")
    text = "".join(f"int32 {name}\n" for name in names)
    text += f"my_msgs/B a\n{'=' * 80}\nMSG: my_msgs/B\nint32 b\n"
    with Bag(tmp_path / "rosbag2", typestore(my_msgs__msg__Own=text)) as bag:
        data = b"\0\1\0\0" + struct.pack("<4i", 1, 2, 3, 4)
        bag.write_raw("/go/_action/feedback", "my_msgs/msg/Own", data)
    convert_alone(bag.folder, ActionToCsv(action="go"))
    (row,) = rows(tmp_path / "action_go_feedback.csv")
    assert sorted(row.values(), key=float)[:4] == ["1", "2", "3", "4"]
    assert float(row["timestamp"]) == START / SECOND


@given(st.lists(st.integers(0, 12), min_size=1, max_size=60))
def test_rows_of_many_shapes_are_placed_in_the_columns_of_all(shapes: list[int]) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        table = CsvTable(path, ["t"], lambda count: [[f"a[{n}]"] for n in range(count)])
        for number, count in enumerate(shapes):
            table.add(count, [b"%d" % number, *(b"%d" % n for n in range(count))])
        table.close()
        found = [{name: cell for name, cell in row.items() if cell} for row in rows(path)]
    assert found == [
        {"t": str(i), **{f"a[{n}]": str(n) for n in range(count)}} for i, count in enumerate(shapes)
    ]


def test_a_table_larger_than_a_disk_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table_module, "_MOST_CELLS", 1000)
    table = CsvTable(
        tmp_path / "table.csv", ["t"], lambda count: [[f"a[{n}]"] for n in range(count)]
    )
    for count in range(50):
        table.add(count, [b"0"] * (count + 1))
    with pytest.raises(InputError, match=r"table\.csv would have 50 rows of 50 columns"):
        table.close()
