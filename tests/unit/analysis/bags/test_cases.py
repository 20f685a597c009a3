"""Bags as other tools and other circumstances write them are read as the format defines."""

from __future__ import annotations

from pathlib import Path
from shutil import copytree
from typing import Any

import pytest
from support.campaigns.bags import rows

from robovast.analysis.bags.convert import convert_run
from robovast.base.yaml_files import parse_yaml
from robovast.model.document.commands import bag_command
from robovast.search.extractors.columns import ColumnExtractor

CASES = Path(__file__).parents[3] / "data" / "cases" / "bags"
DATE = "-2026-11-25-120000"

X = "rosbag2_x.csv"


def counted(first: int, last: int) -> list[str]:
    return [f"{second}000000000" for second in range(first, last + 1)]


def metres(first: int, last: int) -> list[str]:
    return [f"{x}.0" for x in range(first, last + 1)]


@pytest.mark.parametrize(
    ("case", "file", "count", "columns"),
    [
        ("b01-proto-last", X, 20, {}),
        ("b01-proto-nochunk", X, 20, {}),
        ("b03-private-between", X, 20, {"timestamp": counted(1, 20)}),
        ("b06-order-split", X, 10, {"timestamp": counted(1, 10)}),
        ("b16-message-zstd-no-metadata", X, 10, {"timestamp": counted(1, 10)}),
        ("b05-wstring", "rosbag2_name.csv", 20, {"label": ["Zürich"] * 20}),
        (
            "b07-simreset-moved",
            "poses.csv",
            22,
            {"position.x": metres(0, 10) + metres(100, 110), "episode": ["1"] * 11 + ["2"] * 11},
        ),
        ("b08-namespaced-tf", "robot1.csv", 11, {"position.x": metres(0, 10)}),
        ("b08-namespaced-tf", "robot2.csv", 11, {"position.x": metres(5, 15)}),
        ("b09-odom-only", "poses.csv", 11, {"position.x": metres(0, 10)}),
        ("b11-timestamp-suffix", X, 20, {"timestamp": counted(1, 20)}),
        ("b13-def-crlf1", "rosbag2_m.csv", 3, {"n": ["7"] * 3, "x": ["2.5"] * 3}),
        ("b13-def-msgpath", "rosbag2_m.csv", 3, {}),
        ("b14-padded-records", X, 5, {}),
        (
            "b10-time-zero",
            X,
            13,
            {"timestamp": ["0"] * 3 + counted(1_700_000_000, 1_700_000_009)},
        ),
        (
            "b17-service-event",
            "rosbag2_add__service_event.csv",
            6,
            {"timestamp": counted(1, 6), "type": ["my_srvs/srv/Add_Event"] * 6},
        ),
    ],
)
def test_the_rows_are_those_of_an_independent_reader(
    tmp_path: Path, case: str, file: str, count: int, columns: dict[str, list[str]]
) -> None:
    campaign = copytree(CASES / f"{case}{DATE}", tmp_path / case)
    document: Any = parse_yaml((campaign / "_config" / "c.vast").read_text())
    calls = document["results_processing"]["postprocessing"]
    jobs = [bag_command(name, parameters) for call in calls for name, parameters in call.items()]
    done = convert_run(campaign / "c" / "0", jobs)
    assert done.failures == {}
    table = rows(campaign / "c" / "0" / file)
    assert len(table) == count, done.warnings
    for name, cells in columns.items():
        assert [row[name] for row in table] == cells


def test_a_metric_covers_the_rows_of_all_episodes_in_their_order(tmp_path: Path) -> None:
    case = "b07-simreset-moved"
    campaign = copytree(CASES / f"{case}{DATE}", tmp_path / case)
    convert_run(campaign / "c" / "0", [bag_command("rosbags_tf_to_csv", {})])
    column = {"table": "poses", "column": "position.x"}
    over = {name: {**column, "over_time": name} for name in ("first", "last", "max", "mean")}
    assert ColumnExtractor(**over).extract(campaign / "c").objectives == {
        "failure_rate": 0.0,
        "first": 0.0,
        "last": 110.0,
        "max": 110.0,
        "mean": 55.0,
    }
