"""Maps of configurations are told at once, with the ways of their runs."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.campaigns.stored import NAME, add_map, write, write_campaign

from robovast.base.serialization import dump_yaml
from robovast.campaign.verdict import Verdict
from robovast.evaluation.drive.maps import configuration_maps, failure_places
from robovast.evaluation.map_picture import map_records
from robovast.evaluation.poses import rough_way, way
from robovast.evaluation.summaries import RunSummary, VariantRuns

HEAD = "frame,timestamp,position.x,position.y,position.z\n"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    root = write_campaign(tmp_path, runs=3, outputs=False)
    add_map(root, "hall-1")
    return root


def test_every_configuration_has_its_map_and_the_ways_of_its_runs(root: Path) -> None:
    rows = "".join(f"base_link,{i},{i / 10},{-i / 10},0\n" for i in range(1000))
    write(root / "hall-1" / "0" / "poses.csv", HEAD + rows)
    write(root / "hall-1" / "2" / "poses.csv", HEAD + "base_link,0,1.5,2.5,0\n")
    found = configuration_maps(root.parent, NAME, ["hall-2", "hall-1", "none"])
    assert [(c.name, c.ground) for c in found.configurations] == [
        ("hall-2", None),
        ("hall-1", 0),
        ("none", None),
    ]
    (first, way), second = found.configurations[1].ways
    assert (first, second) == (0, (2, [(1.5, 2.5)]))
    assert (way[0], way[-1], len(way)) == ((0.0, 0.0), (99.9, -99.9), 60)
    assert way == sorted(way) == [(x, -x) for x, _ in way]
    assert found.configurations[1].planned.goals
    assert (found.grounds[0].columns, found.grounds[0].rows) == (40, 30)


@given(st.lists(st.integers(2, 12), min_size=1, max_size=4))
def test_no_line_leads_from_one_episode_to_the_next(lengths: list[int]) -> None:
    """A simulation reset takes time back to 0 and the robot to another place."""
    places = [[(float(t), float(number)) for t in range(n)] for number, n in enumerate(lengths)]
    rows = [f"base_link,{x:g},{x},{y},0\n" for part in places for x, y in part]
    with TemporaryDirectory() as name:
        results = Path(name).resolve()
        write(results / "run" / "poses.csv", HEAD + "".join(rows))
        driven = way(results, "run")
        assert driven is not None
        assert driven.episodes == places
        assert driven.last == max(0, lengths[-1] - 1 - 5)
        assert rough_way(results, "run", 60) == places[-1]


def test_of_a_large_table_few_rows_are_read(root: Path) -> None:
    rows = "".join(f"map,{i},{i},{i},0\nbase_link,{i},{i / 10},{-i / 10},0\n" for i in range(9999))
    write(
        root / "hall-1" / "0" / "poses.csv",
        HEAD + rows + "map,9999,9,9,0\nbase_link,9999,nan,9,0\n",
    )
    with (root / "hall-1" / "0" / "poses.csv").open("a") as file:
        file.write("base_link,9999,999.9,-999.9,0\n")
    ((_, way),) = configuration_maps(root.parent, NAME, ["hall-1"]).configurations[0].ways
    assert 20 < len(way) <= 60  # every second row is another frame's
    assert way == sorted(way) == [(x, -x) for x, _ in way]
    assert max(b[0] - a[0] for a, b in pairwise(way)) < 400
    assert way[-1] == (999.9, -999.9)


def test_rows_that_tell_no_place_are_left_out_of_a_way(root: Path) -> None:
    rows = "base_link,0,1,2,0\nbase_link,1,nan,2,0\nbase_link,2\nbase_link,3,x,2,0\n"
    write(root / "hall-1" / "0" / "poses.csv", HEAD + rows + "base_link,4,5,6,0\n")
    found = configuration_maps(root.parent, NAME, ["hall-1"])
    assert found.configurations[0].ways == [(0, [(1.0, 2.0), (5.0, 6.0)])]


def test_only_some_runs_of_a_configuration_have_ways_the_others_ends(root: Path) -> None:
    for number in range(52):
        content = HEAD + f"b,0,0,0,0\nb,1,{number},1,0\n"
        write(root / "hall-1" / str(number) / "poses.csv", content)
    ways = configuration_maps(root.parent, NAME, ["hall-1"]).configurations[0].ways
    assert ways[49] == (49, [(0, 0), (49, 1)])
    assert ways[50:] == [(50, [(50, 1)]), (51, [(51, 1)])]


@pytest.mark.parametrize(
    "content",
    [
        "",
        HEAD,
        HEAD + "base_link,0\n",
        HEAD + "a,0,x,y,0\n",
        HEAD + "a,0,nan,1,0\n",
        HEAD + "a,0,1,1e999,0\n",
        "a,b\n1,2\n",
        "\0",
    ],
)
def test_a_table_that_tells_no_end_is_left_out(root: Path, content: str) -> None:
    write(root / "hall-1" / "0" / "poses.csv", content)
    assert configuration_maps(root.parent, NAME, ["hall-1"]).configurations[0].ways == []


def test_nothing_outside_of_the_results_is_read(root: Path) -> None:
    write(root.parent.parent / "poses.csv", HEAD + "base_link,0,1.5,2.5,0\n")
    (root / "hall-1" / "0" / "poses.csv").symlink_to(root.parent.parent / "poses.csv")
    found = configuration_maps(root.parent, NAME, ["hall-1", "../.."])
    assert [one.ways for one in found.configurations] == [[], []]


def test_only_runs_that_did_not_pass_are_places_of_failure(root: Path) -> None:
    add_map(root, "hall-2")
    runs = tuple(
        RunSummary(number, verdict, "", None, None)
        for number, verdict in enumerate((Verdict.PASSED, Verdict.FAILED, Verdict.ERRORED))
    )
    variants = [VariantRuns(name, "hall", {}, runs) for name in ("hall-1", "hall-2")]
    for variant in variants:
        for number in range(2):
            write(root / variant.name / str(number) / "poses.csv", HEAD + f"b,0,{number},2,0\n")
    found = failure_places(root.parent, NAME, variants)
    assert found.places == [("hall-1", 1, None, 1, 2), ("hall-2", 1, 0, 1, 2)]
    assert len(found.grounds) == 1


def test_equal_maps_of_many_configurations_are_told_once(root: Path) -> None:
    moves = {"map_file": "maps/hall.yaml"}
    add_map(root, "hall-2")
    configs = [{"name": name, "_navigation": moves} for name in ("hall-1", "hall-2")]
    write(root / "_transient" / "configurations.yaml", dump_yaml({"configs": configs}))
    found = configuration_maps(root.parent, NAME, ["hall-1", "hall-2"])
    assert ([one.ground for one in found.configurations], len(found.grounds)) == ([0, 0], 1)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("  _navigation:\n    goals:\n    - x: 1\n      map_file: a\n    map_file: b\n", "b"),
        (
            "  config:\n    map_file: a\n  _navigation:\n    path: []\n  _c:\n    map_file: a\n",
            None,
        ),
        ("  config: {}\n  _navigation: {map_file: b}\n", "b"),
        ("  _navigation:\n    map_file: [\n", None),
    ],
)
def test_the_map_alone_is_read_from_what_was_recorded(
    root: Path, text: str, expected: str | None
) -> None:
    write(root / "_transient" / "configurations.yaml", f"configs:\n- name: hall-1\n{text}")
    found = map_records(root.parent, NAME, ["hall-1"])
    assert found["hall-1"].get("map_file") == expected
