"""CSV files are thinned out, never misread."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import InputError
from robovast.evaluation.tables import MOST_ROWS, read_table, read_usage


def test_numbers_are_numbers_and_text_is_text(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("t,x,name\n0,1.5,a\n1,nan,b\n2,,\n")
    table = read_table(tmp_path, "t.csv")
    assert table.columns == {"t": [0, 1, 2], "x": [1.5, None, None], "name": ["a", "b", ""]}


def test_a_long_table_keeps_its_ends_and_its_order(tmp_path: Path) -> None:
    count = 10 * MOST_ROWS
    (tmp_path / "t.csv").write_text("t\n" + "".join(f"{i}\n" for i in range(count)))
    table = read_table(tmp_path, "t.csv")
    values = table.columns["t"]
    assert (table.rows, len(values) <= MOST_ROWS) == (count, True)
    assert values == list(range(0, count, table.stride))


def test_only_the_columns_that_are_asked_for(tmp_path: Path) -> None:
    names = [f"c{i}" for i in range(500)]
    (tmp_path / "t.csv").write_text(",".join(names) + "\n" + ",".join(map(str, range(500))))
    table = read_table(tmp_path, "t.csv", ["c499", "none"])
    assert (table.names, table.columns) == (names, {"c499": [499]})


def test_rows_that_are_too_short_and_null_bytes_do_no_harm(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_bytes(b"a,b\n1\n2,\x003\n\xff,4\n")
    assert read_table(tmp_path, "t.csv").columns["b"] == [None, 3, 4]


def test_an_empty_file_has_no_columns(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("")
    assert read_table(tmp_path, "t.csv").columns == {}


def test_usage_is_the_sum_of_the_processes(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text(
        "timestamp,pid,name,cpu_percent,memory_rss_bytes\n"
        "1.0,1,sim,50,100\n1.0,2,robot,25,300\n2.0,1,sim,10,100\n2.0,broken\n"
    )
    usage = read_usage(tmp_path, "u.csv")
    assert (usage.time, usage.cpu, usage.memory) == ([1, 2], [75, 10], [400, 100])


def test_another_table_is_no_usage(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="not a record of resource usage"):
        read_usage(tmp_path, "u.csv")


def test_places_and_speeds_come_first_and_covariances_last(tmp_path: Path) -> None:
    covariances = [f"pose.covariance[{i}]" for i in range(36)]
    names = ["type", "header.stamp.nanosec", *covariances, "pose.pose.orientation.w"]
    names += ["pose.pose.position.x", "pose.pose.position.y", "twist.twist.linear.x", "timestamp"]
    (tmp_path / "t.csv").write_text(",".join(names) + "\n" + ",".join("1" for _ in names))
    table = read_table(tmp_path, "t.csv")
    assert table.names == names
    assert list(table.columns)[:7] == [
        *("timestamp", "pose.pose.position.x", "pose.pose.position.y", "twist.twist.linear.x"),
        *("type", "pose.pose.orientation.w", "header.stamp.nanosec"),
    ]
