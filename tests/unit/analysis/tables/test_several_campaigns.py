"""A query over several campaigns gives back the cells of each."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from support.campaigns.finished import finished_campaign

from robovast.analysis.tables.columnar import update_columnar, write_runs
from robovast.analysis.tables.query import ask, tables
from robovast.campaign.layout import COLUMNAR_TABLES, Layout
from robovast.campaign.run_record import COLUMNS

CELLS = st.sampled_from(
    [
        "0",
        "1",
        "2",
        "1.0",
        "0.5",
        "true",
        "false",
        "007",
        "9007199254740993",
        "9007199254740992",
        "0.1234567890123456789",
        "12345678901234567890123",
        "18446744073709551615",
        "nan",
        "x",
        "",
    ]
)


def campaigns(folder: Path, columns: Sequence[Sequence[str]], file: str = "x") -> list[Path]:
    found = []
    for number, cells in enumerate(columns):
        campaign = finished_campaign(folder, 1, name=f"c{number}-2026-01-01-000000")
        with (campaign / f"c-1/0/{file}.csv").open("w", newline="") as out:
            csv.writer(out).writerows([["i", "v"], *enumerate(cells)])
        update_columnar(Layout(campaign), {"c-1/0": "1"})
        found.append(campaign)
    return found


@given(st.lists(st.lists(CELLS, min_size=1, max_size=3), min_size=2, max_size=3))
@example([["9007199254740993", "9007199254740992"], ["0.5", "1.5"]])
@example([["1", "0"], ["true", "false"]])
@example([["1", "2"], ["1.0", "2.0"]])
@example([["0"], ["0", "0.5"]])
@example([["0"], ["0", "1.0"]])
@example([["0.1234567890123456789"], ["12345678901234567890123"]])
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
def test_different_cells_of_campaigns_stay_different(
    tmp_path_factory: pytest.TempPathFactory, columns: list[list[str]]
) -> None:
    found = campaigns(tmp_path_factory.mktemp("all"), columns)
    (count,) = ask(found, "SELECT count(DISTINCT v::VARCHAR) FROM x").rows[0]
    assert count == len({cell for cells in columns for cell in cells} - {""})


@pytest.mark.parametrize(
    ("columns", "type_"),
    [
        ((["1", "2"], ["0.5", "3.0"]), "DOUBLE"),
        ((["1"], ["18446744073709551615"]), "HUGEINT"),
        (([""], ["0.5"]), "DOUBLE"),
        (([""], ["007"]), "VARCHAR"),
        ((["1", "2"], ["1.0"]), "VARCHAR"),
        ((["1", "2"], ["1.0", "0.5"]), "VARCHAR"),
        ((["0", "1"], ["0", "0.5", "1"]), "DOUBLE"),
        ((["0", "0.25"], ["0", "0.5"]), "DOUBLE"),
        ((["0", "0.25"], ["0.0", "0.5"]), "VARCHAR"),
        ((["0.5", "1.5"], ["0.5", "2.0"]), "DOUBLE"),
    ],
)
def test_types_of_different_campaigns_are_united(
    tmp_path: Path, columns: tuple[list[str], list[str]], type_: str
) -> None:
    for order in (columns, columns[::-1]):
        folder = tmp_path / str(order is columns)
        assert tables(campaigns(folder, order))["x"]["v"] == type_


@pytest.mark.parametrize(
    ("one", "other", "type_"),
    [
        ([1, 2], [1.0, 0.5], "DOUBLE"),
        ([2**53, 2**53 + 1], [0.5], "VARCHAR"),
        ([1], ["a"], "VARCHAR"),
    ],
)
def test_types_of_parameters_are_united(
    tmp_path: Path, one: list[object], other: list[object], type_: str
) -> None:
    folders = []
    for name, values in (("a", one), ("b", other)):
        path = tmp_path / name / COLUMNAR_TABLES
        path.parent.mkdir(parents=True)
        empty = dict.fromkeys(COLUMNS)
        write_runs(
            path,
            [{**empty, "config": "c", "run": n, "param_p": v} for n, v in enumerate(values)],
        )
        folders.append(tmp_path / name)
    assert tables(folders)["runs"]["param_p"] == type_


@pytest.mark.parametrize(
    ("cells", "type_"),
    [
        (("0", "0.5\n0"), "DOUBLE"),
        (("0.5\n0", "0"), "DOUBLE"),
        (("0.5\n0", "0", "2.5", "0.0"), "VARCHAR"),
        (("1", "0.5\n1.0"), "VARCHAR"),
    ],
)
def test_runs_that_arrive_later_keep_numbers(
    tmp_path: Path, cells: tuple[str, ...], type_: str
) -> None:
    campaign = finished_campaign(tmp_path, len(cells))
    versions: dict[str, str] = {}
    for run, text in zip(Layout(campaign).run_folders(), cells, strict=True):
        (run / "x.csv").write_text(f"v\n{text}\n")
        versions[f"{run.parent.name}/{run.name}"] = "1"
        update_columnar(Layout(campaign), versions)
    assert tables([campaign])["x"]["v"] == type_
    if type_ == "VARCHAR":
        found = ask([campaign], "SELECT v FROM x").rows
        assert sorted(v for (v,) in found) == sorted("\n".join(cells).split("\n"))


def test_numbers_that_become_text_have_their_spelling(tmp_path: Path) -> None:
    found = ask(campaigns(tmp_path, [["0", "0.25"], ["0.0", "0.5"], ["3"]]), "SELECT v FROM x")
    assert sorted(v for (v,) in found.rows) == ["0", "0.0", "0.25", "0.5", "3"]


def test_tables_whose_names_differ_in_case_are_one(tmp_path: Path) -> None:
    upper = campaigns(tmp_path / "1", [["1"], ["2"]], "Case")
    lower = campaigns(tmp_path / "2", [["3"]], "case")
    for order in (upper + lower, lower + upper):
        assert ask(order, 'SELECT v FROM "cAse" ORDER BY v').rows == [
            (1,),
            (2,),
            (3,),
        ]


@pytest.mark.parametrize("size", [3_000_000, 9_000_000])
def test_a_huge_cell_is_read(tmp_path: Path, size: int) -> None:
    (campaign,) = campaigns(tmp_path, [["1", "é" * size, '"' * 10]], "log")
    assert ask([campaign], "SELECT length(v) FROM log ORDER BY i").rows == [(1,), (size,), (10,)]
    assert ask([campaign], "SELECT v FROM out").rows == [(0,)]
