"""CSV files of every supported form are read, and what is lost of others is reported."""

from __future__ import annotations

import csv
import io
import logging
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robovast.analysis.tables.csv_files import csv_rows, is_plain, read_header, read_rows

CASES = Path(__file__).parents[3] / "data/cases/tables"


def rows_of(content: bytes) -> list[list[str]]:
    return list(csv_rows(io.BytesIO(content)))


@pytest.mark.parametrize(
    ("content", "rows"),
    [
        (b"# made by a tool\nt,x\n0,1\n", [["t", "x"], ["0", "1"]]),
        (b"# made by\n# a tool, 2026, x\nt,x\n0,1\n", [["t", "x"], ["0", "1"]]),
        (b"# a, b\nt,x\n0,1\n", [["t", "x"], ["0", "1"]]),
        (b"# t,x\n0,1\n2,3\n", [["t", "x"], ["0", "1"], ["2", "3"]]),  # NumPy's header
        (
            b"#t [ns],file\r\n5,5.png\r\n6,6.png\r\n",
            [["t [ns]", "file"], ["5", "5.png"], ["6", "6.png"]],
        ),
        (b"\n# a comment\n\nt,x\n0,1\n", [["t", "x"], ["0", "1"]]),
        (b"# one\nvalue\n7\n", [["value"], ["7"]]),
        (b"t,x\n# pause\n0,1\n", [["t", "x"], ["0", "1"]]),
        (b"tag,x\n#1,2\n", [["tag", "x"], ["#1", "2"]]),
        (b"\xef\xbb\xbf# c\nt,x\n0,1\n", [["t", "x"], ["0", "1"]]),
        (b't,x\r\n0,"a\r\nb"\r\n\r\n', [["t", "x"], ["0", "a\r\nb"]]),
        (b"# only\n", [["only"]]),
        (b"sep=,\r\nt,x\r\n0,1\r\n", [["t", "x"], ["0", "1"]]),  # Excel's first line
        (b"sep=,,x\n0,1,2\n", [["sep=", "", "x"], ["0", "1", "2"]]),
        (b"", []),
        (b"\n\n", []),
    ],
)
def test_comments_above_and_below_the_header(content: bytes, rows: list[list[str]]) -> None:
    assert rows_of(content) == rows


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"t;x\n0;1\n", "its cells are separated by `;`"),
        (b"t\tx\n0\t1\n", "its cells are separated by tabs"),
        (b"sep=;\nt;x\n0;1\n", "its cells are separated by `;`"),
        (b"a" + b"," * 500_000 + b"\n", "it has 500,001 columns; at most 5,000 are read"),
        ("t,x\n0,1\n".encode("utf-16-le"), "UTF-16 without a byte order mark"),
        ("t,x\n0,1\n".encode("utf-16-be"), "UTF-16 without a byte order mark"),
    ],
)
def test_other_forms_are_refused_with_one_message(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, content: bytes, said: str
) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        assert read_header(path) == read_header(path) == []
    (message,) = caplog.messages
    assert message.startswith(f"{path} is not read: ")
    assert said in message


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"t,x\n0,1,2\n", "rows with more cells than the header"),
        (b"t,x\n0,\xff\n", "bytes that are not valid text"),
        (b't,x\n0,1\n2,"3\n4,5\n', "is not read to its end: a quoted cell is not closed"),
    ],
)
def test_what_is_lost_is_reported_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, content: bytes, said: str
) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        assert [list(read_rows(path, 2))[0][0] for _ in range(2)] == ["0", "0"]  # noqa: RUF015
    (message,) = caplog.messages
    assert message.startswith(f"{path} ")
    assert said in message


def test_the_stored_files_have_the_cells_of_pythons_reader() -> None:
    for path in CASES.glob("*.csv"):
        encoding = "utf-16" if path.name == "utf16.csv" else "utf-8"
        right = list(csv.reader(path.read_text(encoding).splitlines(keepends=True)))
        assert rows_of(path.read_bytes()) == right
        assert is_plain(path) == (path.name != "utf16.csv")


CELLS = st.text(st.characters(codec="utf-16", exclude_characters="\0\r"), max_size=6)
TABLES = st.integers(2, 4).flatmap(
    lambda width: st.lists(st.lists(CELLS, min_size=width, max_size=width), min_size=1, max_size=5)
)


@given(
    TABLES,
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-32"]),
    st.sampled_from(["", "# a comment\n", "#\n#,,,,,,\n"]),
)
def test_any_cells_are_read_as_they_were_written(
    table: list[list[str]], encoding: str, comments: str
) -> None:
    text = io.StringIO()
    csv.writer(text, quoting=csv.QUOTE_ALL).writerows(table)
    assert rows_of((comments + text.getvalue()).encode(encoding)) == table


@given(st.binary(max_size=80) | st.text('ab,#"\n;\t\0', max_size=40).map(str.encode))
def test_any_bytes_are_rows_or_refused(content: bytes) -> None:
    try:
        rows_of(content)
    except csv.Error as error:
        assert str(error), "a message"  # noqa: PT017
