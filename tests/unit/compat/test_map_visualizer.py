"""Drawing on maps as notebooks of the existing tool do."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import pytest

from robovast.navigation.occupancy import OccupancyMap, write_map
from robovast_nav.gui import MapVisualizer

matplotlib.use("agg")


@pytest.fixture
def map_file(tmp_path: Path) -> Path:
    occupied = np.zeros((20, 40), bool)
    occupied[0] = True
    path = tmp_path / "hall.yaml"
    write_map(OccupancyMap(~occupied, occupied, 0.05, (-1.0, -0.5)), path)
    return path


def test_results_are_drawn_on_a_map(map_file: Path, tmp_path: Path) -> None:
    drawing = MapVisualizer()
    assert drawing.load_map(str(map_file))
    figure, axes = drawing.create_figure(figsize=(4, 2))
    assert (drawing.fig, drawing.ax) == (figure, axes)
    drawing.draw_path([(0, 0), (0.5, 0.2)], label="driven")
    drawing.draw_waypoints([{"x": 0.1, "y": 0.1}, {"position": {"x": 0.2, "y": 0.1}}])
    drawing.add_robot_pose(0.0, 0.0, theta=1.5)
    drawing.draw_circle(0.3, 0.0, radius=0.1)
    drawing.draw_obstacle(0.2, 0.1, {"radius": 0.1, "color": "red"})
    spawn = {"position": {"x": 0.4, "y": 0.1}, "orientation": {"yaw": 0.5}}
    drawing.draw_obstacles([{"spawn_pose": spawn, "xacro_arguments": "width:=0.2 length:=0.1"}])
    drawing.show_legend()
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["driven", "Waypoints"]
    shapes = [type(patch).__name__ for patch in axes.patches]
    assert shapes == ["Circle", "Circle", "Circle", "Rectangle"]
    drawing.save_figure(tmp_path / "map.png", dpi=50)
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_pixels_and_metres(map_file: Path) -> None:
    drawing = MapVisualizer()
    drawing.load_map(map_file)
    assert drawing.get_map_bounds() == (-1.0, 1.0, -0.5, 0.5)
    assert drawing.pixel_to_world(0, 0) == (-1.0, 0.5)
    assert drawing.world_to_pixel(-1.0, 0.5) == (0, 0)


def test_what_cannot_be_drawn_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawing = MapVisualizer()
    assert not drawing.load_map(tmp_path / "absent.yaml")
    assert "absent.yaml" in capsys.readouterr().out
    with pytest.raises(ValueError, match="create_figure"):
        drawing.draw_path([(0, 0)])
    with pytest.raises(ValueError, match="load_map"):
        drawing.get_map_bounds()
