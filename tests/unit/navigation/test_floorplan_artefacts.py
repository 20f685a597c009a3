"""Map, mesh and graph agree with the floor plan."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rdflib import Graph

from robovast.navigation.costmap import Costmap
from robovast.navigation.floorplan.artefacts import make_artefacts
from robovast.navigation.floorplan.language import read_floorplan
from robovast.navigation.floorplan.layout import lay_out
from robovast.navigation.floorplan.mesh import mesh_of, to_stl
from robovast.navigation.floorplan.render import render

PLAN = """\
Floor plan: two
    Space left:
        shape: Rectangle width=4.0 m, length=5.0 m
        location:
            wrt: world
            translation: x: 2.0 m, y: 2.5 m
        features:
            Divider board:
                shape: Rectangle width=1.0 m, length=0.01 m
                height: 1.0 m
                location:
                    wrt: this
    Space right:
        shape: Rectangle width=3.0 m, length=5.0 m
        location:
            wrt: left.walls[1]
            of: this.walls[3]
            spaced
    Entryway door:
        shape: Rectangle width=1.0 m, height=2.0 m
        location:
            in: left.walls[1] and right.walls[3]
            translation: x: 1.0 m, z: 1.0 m
    Window view:
        shape: Rectangle width=1.0 m, height=1.0 m
        location:
            in: left.walls[0]
            translation: z: 1.2 m
    Defaults:
        walls:
            thickness: 0.2 m
            height: 2.5 m
"""


@pytest.fixture
def plan(tmp_path: Path):
    path = tmp_path / "two.fpm"
    path.write_text(PLAN)
    return read_floorplan(path)


def at(mask: np.ndarray, occupancy, x: float, y: float) -> bool:
    row, column = (round(value) for value in occupancy.cell((x, y)))
    return bool(mask[row, column])


def test_the_map_shows_rooms_walls_and_doorways(plan) -> None:
    occupancy = render(lay_out(plan))
    for x, y in [(0.05, 0.05), (3.9, 4.9), (4.5, 4.9), (7.3, 0.1), (4.2, 1.5)]:
        assert at(occupancy.free, occupancy, x, y), (x, y)  # rooms; last, the doorway
    for x, y in [(-0.1, 2.0), (4.2, 2.5), (7.5, 2.5), (2.0, 5.1)]:
        assert at(occupancy.occupied, occupancy, x, y), (x, y)  # walls; last, below the window
    assert not at(occupancy.free | occupancy.occupied, occupancy, -0.4, 2.0)  # outside
    rooms = 4 * 5 + 3 * 5 + 0.4 * 1.0
    assert occupancy.free.sum() * 0.05**2 == pytest.approx(rooms, abs=0.2)


def test_what_is_thinner_than_a_cell_is_in_the_map(plan) -> None:
    occupancy = render(lay_out(plan))
    assert all(at(occupancy.occupied, occupancy, x, 2.5) for x in np.arange(1.6, 2.5, 0.05))


def test_a_robot_can_go_through_the_door_alone(plan) -> None:
    costmap = Costmap(render(lay_out(plan)), 0.4)
    way = costmap.shortest_path((1.0, 4.0), (6.0, 4.0))
    assert way is not None
    crossing = [y for x, y in way if 3.9 < x < 4.5]
    assert crossing
    assert all(1.0 < y < 2.0 for y in crossing)


def test_the_mesh_is_closed_and_has_the_volume_of_the_walls(plan) -> None:
    solid = mesh_of(lay_out(plan))
    walls = (4.4 * 5.4 - 4 * 5 + 3.4 * 5.4 - 3 * 5) * 2.5
    holes = 1.0 * 2.0 * 0.4 + 1.0 * 1.0 * 0.2
    board = 1.0 * 0.01 * 1.0
    assert solid.volume() == pytest.approx(walls - holes + board, rel=1e-3)
    assert solid.genus() >= 1  # the door and the window are holes through it


def test_the_stl_file_is_what_the_format_says(plan) -> None:
    data = to_stl(mesh_of(lay_out(plan)))
    count = int(np.frombuffer(data[80:84], "<u4")[0])
    assert len(data) == 84 + 50 * count
    facets = np.frombuffer(data[84:], np.dtype([("f", "<f4", 12), ("a", "<u2")]))["f"]
    corners = facets.reshape(-1, 4, 3)[:, 1:]
    assert corners.min(axis=(0, 1)) == pytest.approx([-0.2, -0.2, 0.0], abs=1e-5)
    assert corners.max(axis=(0, 1)) == pytest.approx([7.6, 5.2, 2.5], abs=1e-5)


def test_an_opening_is_at_its_height(plan) -> None:
    solid = mesh_of(lay_out(plan))

    def wall_at(z: float) -> float:
        return float(solid.slice(z).area())

    whole = wall_at(2.4)
    assert wall_at(0.3) - 0.01 == pytest.approx(whole - 1.0 * 0.4, abs=1e-3)  # door; the board
    assert wall_at(1.5) == pytest.approx(whole - 0.4 - 0.2, abs=1e-3)  # door and window


@pytest.mark.filterwarnings("ignore:ConjunctiveGraph:DeprecationWarning")  # rdflib's own
def test_the_graph_is_understood_without_other_files(plan, tmp_path: Path) -> None:
    made = make_artefacts(plan, "two", tmp_path)
    graph = Graph()
    for name in made.graph:
        graph.parse(tmp_path / name, format="json-ld")
    rows = graph.query(
        """
        PREFIX env: <https://purl.org/secorolab/metamodels/environment#>
        SELECT ?x WHERE {
            ?plan env:hasOpening ?door . ?door a env:Entryway ; env:frame ?frame .
            ?pose env:of ?frame ; env:x ?x .
        }
        """
    )
    assert [float(row.x) for row in rows] == [4.0]


def test_equal_plans_give_equal_bytes(plan, tmp_path: Path) -> None:
    contents = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        made = make_artefacts(plan, "two", tmp_path / name)
        contents.append([Path(source).read_bytes() for _, source in made.files])
    assert contents[0] == contents[1]
    assert json.loads(contents[0][-1])["@context"]
