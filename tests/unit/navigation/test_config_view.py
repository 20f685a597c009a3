"""`vast config view`: pictures of configurations, and the example that has some."""

from __future__ import annotations

import io
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from robovast.model.document import load_document
from robovast.model.expansion import expand
from robovast_cli.main import command

EXAMPLE = Path(__file__).parents[3] / "configs" / "examples" / "floor_plans" / "floor_plans.vast"
SVG = "{http://www.w3.org/2000/svg}"

MOVES = [
    {
        "PathVariationRandom": {
            "start_pose": {"x": 1.0, "y": 3.0},
            "goal_poses": [{"x": 4.0, "y": 3.0}, {"x": 8.0, "y": 1.0}],
            "map_file": "hall.yaml",
            "path_length": 7.7,
        }
    },
    {
        "ObstacleVariation": {
            "name": "obstacles",
            "obstacle_configs": [{"amount": 2, "max_distance": 1.0, "model": "box"}],
            "count": 2,
        }
    },
]


def vast(path: Path, *arguments: object) -> int:
    with pytest.raises(SystemExit) as caught:
        command().main(["-V", str(path), "config", "view", *map(str, arguments)])
    return int(caught.value.code or 0)


def test_a_picture_shows_start_goals_path_and_obstacles(document, tmp_path: Path) -> None:
    assert vast(document(*MOVES), tmp_path / "out") == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["hall-1-1.svg", "hall-1-2.svg"]
    root = ElementTree.parse(tmp_path / "out/hall-1-1.svg").getroot()  # noqa: S314  # our own
    assert root.findtext(f"{SVG}title") == "hall-1-1"
    assert [text.text for text in root.iter(f"{SVG}text")] == ["1", "2", "S"]
    assert len(list(root.iter(f"{SVG}circle"))) == 3 + 2
    # 10 m are 800 pixels, and y grows downwards.
    start = list(root.iter(f"{SVG}circle"))[-1].attrib
    assert (float(start["cx"]), float(start["cy"])) == pytest.approx((80.0, (6 - 3) * 80.0))


def test_png_shows_the_same(document, tmp_path: Path) -> None:
    assert vast(document(*MOVES), tmp_path / "out", "--format", "png", "--config", "*-2") == 0
    (path,) = (tmp_path / "out").iterdir()
    image = Image.open(io.BytesIO(path.read_bytes()))
    assert image.info["Title"] == "hall-1-2"
    pixels = np.asarray(image.convert("RGB")).astype(int)
    assert pixels.shape == (480, 800, 3)
    green = (pixels[..., 1] > pixels[..., 0] + 60) & (pixels[..., 1] > pixels[..., 2] + 60)
    columns = np.nonzero(green)[1]
    assert (columns.min() + columns.max()) / 2 == pytest.approx(80, abs=16)
    assert pixels[2, 2].tolist() == [40, 40, 40]  # the wall around the hall


def test_nothing_to_draw(document, tmp_path: Path, capsys) -> None:
    path = document({"ParameterVariationList": {"name": "map_file", "values": ["hall.yaml"]}})
    assert vast(path, tmp_path / "out") == 2
    assert "no configuration has a map to draw" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_example_expands(tmp_path: Path) -> None:
    variants = expand(load_document(EXAMPLE), tmp_path)
    assert len(variants) == 2 * 3 + 3 * 1 * 2
    assert all(
        {"map_file", "mesh_file", "start_pose", "goal_pose"} <= set(v.parameters) for v in variants
    )
