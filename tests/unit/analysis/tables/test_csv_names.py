from __future__ import annotations

from pathlib import Path

import pytest

from robovast.analysis.tables.csv_files import (
    column_names,
    csv_files,
    read_header,
    read_rows,
    table_name,
)


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("poses", "poses"),
        ("rosbag2_tf", "rosbag2_tf"),
        ("logs/cpu usage", "logs_cpu_usage"),
        ("2d-map", "t_2d_map"),
        ("runs", "runs_csv"),
        ("Größe", "Größe"),
        ("--", "table"),
        ("SQLite_x", "t_SQLite_x"),
    ],
)
def test_table_names(path: str, name: str) -> None:
    assert table_name(path) == name


def test_column_names_differ_from_the_keys_and_from_each_other() -> None:
    assert column_names(["run", "Run", "a", "A", "", "pos\0ition.x", ' b"']) == [
        "run_2",
        "Run_3",
        "a",
        "A_2",
        "column_5",
        "position.x",
        "b'",
    ]


def test_files_with_one_table_name_are_not_mixed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "x").mkdir()
    for name in ("A.csv", "a.csv", "x/y.csv", "x_y.csv"):
        (tmp_path / name).touch()
    assert csv_files(tmp_path) == {"A": tmp_path / "A.csv", "x_y": tmp_path / "x_y.csv"}
    assert [message.split()[0] for message in caplog.messages] == [
        str(tmp_path / "a.csv"),
        str(tmp_path / "x/y.csv"),
    ]


def test_the_csv_files_of_a_run_are_its_own(tmp_path: Path) -> None:
    run, job = tmp_path / "c/0", tmp_path / "_jobs/job-0"
    for path in (run / "logs", job):
        path.mkdir(parents=True)
    (run / "job").symlink_to("../../_jobs/job-0")
    for path in (run / "poses.csv", run / "logs/x.csv", run / "out.txt", job / "usage.csv"):
        path.write_text("a\n1\n")
    (run / "Of Windows.CSV").write_text("a\n1\n")
    assert csv_files(run) == {
        "poses": run / "poses.csv",
        "logs_x": run / "logs/x.csv",
        "Of_Windows": run / "Of Windows.CSV",
    }


def test_damaged_rows_are_read_as_far_as_they_can_be(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(b'\xef\xbb\xbfa,b\r\n1,"x,\ny"\r\n\r\n2\r\n3,4,5\r\n\xff,6')
    assert read_header(path) == ["a", "b"]
    assert list(read_rows(path, 2)) == [["1", "x,\ny"], ["2", ""], ["3", "4"], ["\ufffd", "6"]]
    path.write_bytes(b"")
    assert read_header(path) == []
