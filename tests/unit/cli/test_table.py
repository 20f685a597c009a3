"""Tables fit the terminal; nothing is cut where no terminal is."""

from __future__ import annotations

import pytest

from robovast_cli.ui.table import MOST_LINES, NARROWEST, fitting, format_table

ROW = ["hall-1", "no way to the goal after twelve attempts", "x" * 90]


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "50")


@pytest.mark.usefixtures("terminal")
def test_a_table_fits_the_terminal_and_breaks_no_word() -> None:
    lines = format_table(["NAME", "REASON", "BLOB"], [ROW]).splitlines()
    assert max(map(len, lines)) <= 50
    assert lines[1].startswith("hall-1  no way to the goal")
    words = " ".join(line[8:28] for line in lines[1:]).split()
    assert words == ROW[1].split()
    assert "x…" in lines[1]


@pytest.mark.usefixtures("terminal")
def test_a_very_long_cell_ends() -> None:
    lines = format_table(["A", "B"], [["a", "word " * 1000]]).splitlines()
    assert len(lines) == 1 + MOST_LINES
    assert lines[-1].endswith("…")


def test_what_no_terminal_shows_is_whole() -> None:
    assert format_table(["NAME", "REASON", "BLOB"], [ROW]).splitlines()[1] == "  ".join(ROW)


def test_names_and_values_of_several_lines_stay_in_their_row() -> None:
    assert format_table(["NAME", "a\nb"], [["hall-1", "c\rd"]]).count("\n") == 2


@pytest.mark.parametrize(
    ("widths", "width", "expected"),
    [
        ([4, 5], 80, [4, 5]),
        ([4, 60, 40], 60, [4, 26, 26]),
        ([4, 60, 10], 60, [4, 42, 10]),
        ([70, 10], 60, [52, 6]),
        ([8] * 30, 60, [NARROWEST] * 30),
    ],
)
def test_the_widest_columns_are_cut_first_and_the_first_one_last(
    widths: list[int], width: int, expected: list[int]
) -> None:
    assert fitting(widths, width) == expected
