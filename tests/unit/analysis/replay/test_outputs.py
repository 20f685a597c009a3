"""Outputs of two executions are the same, or their first difference is told."""

from __future__ import annotations

import os
import tracemalloc
from pathlib import Path

import pytest
from support.campaigns.bags import Bag

from robovast.analysis.replay.outputs import ALL_TABLES, OutputComparison, compare_outputs
from robovast.base.safe_paths import MOST
from robovast.model.document.execution import Output

TABLE = "step,x\n0,1.5\n1,2.5\n"


def compared(tmp_path: Path, before: str, now: str, *outputs: Output) -> OutputComparison:
    for name, text in (("before", before), ("now", now)):
        path = tmp_path / name / "0" / "sub" / "out.csv"
        path.parent.mkdir(parents=True)
        path.write_text(text, newline="")
    return compare_outputs(tmp_path / "before/0", tmp_path / "now/0", outputs or ALL_TABLES)


def test_equal_files_are_the_same(tmp_path: Path) -> None:
    assert compared(tmp_path, TABLE, TABLE) == OutputComparison(("sub/out.csv",), ())


@pytest.mark.parametrize(
    ("now", "said"),
    [
        ("step,x\n0,1.5\n1,2.6\n", "differs in row 3, column x: 2.6 instead of 2.5"),
        ("step,y\n0,1.5\n1,2.5\n", "differs in row 1, column x: y instead of x"),
        ("step,x\n0,1.5\n", "has fewer rows: it differs from row 3"),
        (TABLE + "2,3.5\n", "has more rows: it differs from row 4"),
        ("step,x\n0,1.5,7\n1,2.5\n", "differs in row 2, column 3: 7 instead of nothing"),
        ("", "has fewer rows: it differs from row 1"),
    ],
)
def test_the_first_difference_of_a_table_is_told(tmp_path: Path, now: str, said: str) -> None:
    assert compared(tmp_path, TABLE, now).differences == (f"sub/out.csv {said}",)


@pytest.mark.parametrize(("tolerance", "same"), [(0, False), (0.01, False), (0.2, True)])
def test_numbers_may_differ_by_a_tolerance(tmp_path: Path, tolerance: float, same: bool) -> None:
    output = Output(pattern="sub/*.csv", tolerance=tolerance)
    found = compared(tmp_path, TABLE, TABLE.replace("2.5", "2.6"), output)
    assert bool(found.same) is same
    assert bool(found.differences) is not same


def test_text_has_no_tolerance(tmp_path: Path) -> None:
    output = Output(pattern="out.csv", tolerance=1000)
    found = compared(tmp_path, "x\nnan\nleft\n", "x\nnan\nright\n", output)
    assert found.differences == ("sub/out.csv differs in row 3, column x: right instead of left",)


def test_other_files_are_compared_byte_by_byte(tmp_path: Path) -> None:
    for name, content in (("before", b"\0" * 3_000_000), ("now", b"\0" * 2_999_999 + b"\1")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "map.pgm").write_bytes(content)
    outputs = [Output(pattern="*.pgm")]
    found = compare_outputs(tmp_path / "before", tmp_path / "now", outputs)
    assert found.differences == ("map.pgm differs from byte 2999999",)


def test_what_is_missing_new_derived_or_a_link_is_told(tmp_path: Path) -> None:
    before, now = tmp_path / "c/v/0", tmp_path / "d/v/0"
    for folder in (before, now):
        folder.mkdir(parents=True)
        (folder / "link.csv").symlink_to(tmp_path / "elsewhere.csv")
    (tmp_path / "elsewhere.csv").write_text("secret\n")
    (before / "gone.csv").write_text(TABLE)
    (now / "new.csv").write_text(TABLE)
    (before / "poses.csv").write_text(TABLE)
    (before / "postprocessing.yaml").write_text("entries: [{output: c/v/0/poses.csv}]\n")
    found = compare_outputs(before, now, ALL_TABLES)
    assert [text for text in found.differences if "link" not in text] == [
        "gone.csv is missing",
        "new.csv is new",
    ]
    assert "secret" not in str(found)
    assert found.same == ()


def sized(tmp_path: Path, size: int, content: bytes = b"") -> OutputComparison:
    """Compare a table of one row with one of this size, whose end was never written."""
    for name, begin in (("before", content), ("now", b"x\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "out.csv").write_bytes(begin)
    os.truncate(tmp_path / "before/out.csv", size)
    return compare_outputs(tmp_path / "before", tmp_path / "now", ALL_TABLES)


def test_a_sparse_file_is_not_read(tmp_path: Path) -> None:
    said = f"out.csv cannot be compared: {2**43} of its {2**43} bytes were never written"
    assert sized(tmp_path, 2**43).differences == (said,)


@pytest.mark.parametrize("content", [b"", (b'"' + b"y" * 999 + b'\n",') * 20_000])
def test_a_row_without_end_takes_little_memory(tmp_path: Path, content: bytes) -> None:
    tracemalloc.start()
    found = sized(tmp_path, 2**29, content)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    said = f"out.csv cannot be compared: a row has more than {MOST} characters"
    assert found.differences == (said,)
    assert peak < 2**29


def bag(folder: Path, values: list[float], topic: str = "/odom", late: float = 0.0) -> None:
    with Bag(folder / "rosbag2") as writer:
        for index, value in enumerate(values):
            writer.write(topic, writer.make("std_msgs/msg/Float64", value), index + late)
            writer.write("/clock", writer.make("std_msgs/msg/Float64", late), index + late)


def test_messages_of_a_topic_are_compared_whenever_they_came(tmp_path: Path) -> None:
    outputs = [Output(pattern="*.mcap:/odom")]
    assert (outputs[0].files, outputs[0].topic) == ("*.mcap", "/odom")
    runs = [tmp_path / name for name in ("before", "same", "other", "fewer", "none")]
    for run in runs:
        run.mkdir()
    bag(runs[0], [1.0, 2.0, 3.0])
    bag(runs[1], [1.0, 2.0, 3.0], late=0.5)
    bag(runs[2], [1.0, 2.5, 3.0])
    bag(runs[3], [1.0, 2.0])
    bag(runs[4], [1.0], topic="/other")
    same, other, fewer, none = (compare_outputs(runs[0], run, outputs) for run in runs[1:])
    (name,) = same.same
    assert name.endswith(".mcap:/odom")
    assert other.differences == (f"{name} differs from message 2 of 3",)
    assert fewer.differences == (f"{name} has 2 messages instead of 3",)
    assert none.differences == (f"{name} has 0 messages instead of 3",)
    assert compare_outputs(runs[4], runs[4], outputs).differences == (
        f"{name} cannot be compared: neither has a message on /odom",
    )
