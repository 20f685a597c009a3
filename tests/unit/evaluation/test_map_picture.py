"""The page draws a configuration on its map, from a campaign that anyone may have written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from support.campaigns.stored import MOVES, NAME, add_map, record_moves, write, write_campaign

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.evaluation.confined_files import OutsideError
from robovast.evaluation.map_picture import draw_map, has_map
from robovast.evaluation.run import read_run

Draw = Callable[[Any], str]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return write_campaign(tmp_path.resolve() / "results", runs=1)


@pytest.fixture
def draw(root: Path) -> Draw:
    """Draw hall-1, of which navigation variations have recorded this."""
    add_map(root, "hall-1")

    def call(record: Any) -> str:
        record_moves(root, "hall-1", record)
        return draw_map(root.parent, NAME, "hall-1")

    return call


def test_the_picture_shows_start_goals_path_and_obstacles(draw: Draw, root: Path) -> None:
    picture = ElementTree.fromstring(draw(MOVES))  # noqa: S314  # our own
    tags = [element.tag.rpartition("}")[2] for element in picture]
    assert (tags.count("image"), tags.count("circle"), tags.count("polyline")) == (1, 3, 3)
    assert read_run(root.parent, NAME, "hall-1", 0).on_map
    assert not has_map(root.parent, NAME, "hall-10")


def test_an_obstacle_has_its_true_shape_where_the_parameters_tell_it(root: Path) -> None:
    add_map(root, "hall-1")
    place = {"position": {"x": 1.0, "y": 0.5}, "orientation": {"yaw": 0.0}}
    box = {"spawn_pose": place, "xacro_arguments": "length:=0.5, width:=0.25, height:=1.0"}
    pole = {"spawn_pose": {"position": {"x": 1.5, "y": 0.5}, "orientation": {"yaw": 0.0}}}
    there = [{"x": x, "y": 0.5, "radius": 0.3} for x in (1.0, 1.5)]
    record_moves(root, "hall-1", {**MOVES, "obstacles": there}, obstacles=[box, pole, "junk"])
    picture = ElementTree.fromstring(draw_map(root.parent, NAME, "hall-1"))  # noqa: S314
    (polygon,) = (one for one in picture if one.tag.endswith("polygon"))
    points = [tuple(map(float, point.split(","))) for point in polygon.get("points", "").split()]
    wide, high = (max(values) - min(values) for values in zip(*points, strict=True))
    assert wide == pytest.approx(2 * high, rel=0.05)
    discs = [one for one in picture if one.tag.endswith("circle")]
    assert len(discs) == 3  # the pole, the start and the goal


def test_a_map_that_all_configurations_share_is_found(draw: Draw, root: Path) -> None:
    (root / "hall-1" / "_config" / "maps").rename(root / "_config" / "maps")
    assert draw(MOVES).startswith("<svg")


def test_a_campaign_without_maps_has_none(root: Path) -> None:
    assert not has_map(root.parent, NAME, "hall-1")
    with pytest.raises(InputError):
        draw_map(root.parent, NAME, "hall-1")


@pytest.mark.parametrize("image", ["../../../../../secret.pgm", "/etc/passwd", "link.pgm"])
def test_no_image_leads_out_of_the_results_folder(draw: Draw, root: Path, image: str) -> None:
    folder = root / "hall-1" / "_config" / "maps"
    (root.parents[1] / "secret.pgm").write_bytes((folder / "hall.pgm").read_bytes())
    (folder / "link.pgm").symlink_to(root.parents[1] / "secret.pgm")
    write(folder / "hall.yaml", dump_yaml({"image": image, "resolution": 0.1, "origin": [0, 0, 0]}))
    with pytest.raises(OutsideError):
        draw(MOVES)


@pytest.mark.parametrize(
    "change",
    [
        {"path": "<script>"},
        {"path": [["<script>", 1.0]]},
        {"path": [[1e400, 1.0]]},
        {"start": {"x": "<script>", "y": 0.0}},
        {"goals": 7},
        {"obstacles": [{"x": 1.0, "y": 1.0}]},
        {"robot_diameter": "wide"},
        {"map_file": ["maps/hall.yaml"]},
    ],
)
def test_what_cannot_be_drawn_is_an_error_with_words(draw: Draw, change: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        draw(MOVES | change)


@pytest.mark.parametrize("content", [b"no image", b"P5\n60000 60000\n255\n"])
def test_an_image_that_is_none_or_too_large_is_refused(
    draw: Draw, root: Path, content: bytes
) -> None:
    (root / "hall-1" / "_config" / "maps" / "hall.pgm").write_bytes(content)
    with pytest.raises(InputError, match=r"hall\.pgm"):
        draw(MOVES)
