"""The floor-plan language: what can be written, and where an error is said to be."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from shapely import Point

from robovast.base.errors import DocumentError
from robovast.navigation.floorplan.language import read_floorplan
from robovast.navigation.floorplan.layout import lay_out
from robovast.navigation.floorplan.model import Circle, FrameRef, Polygon, Rectangle
from robovast.navigation.floorplan.text import write_floorplan

TWO_ROOMS = """\
// two rooms and a door
Floor plan: two

    Defaults:
        walls:
            thickness: 20 cm
            height: 2.5 m

    var wide = 4.0 m

    Space left:
        shape: Rectangle width=wide, length=5.0 m
        location:
            wrt: world
            of: this
            translation: x: 2.0 m, y: 2.5 m
        features:
            Column pillar:
                shape: Circle radius=0.25 m
                height: 2.0 m
                location:
                    wrt: this.walls[3]
                    translation: x: 1.0 m, y: -0.5 m
                    rotation: z: 90.0 deg

    Space right:
        shape: Polygon points:[(-1.5 m, 2.5 m), (1.5 m, 2.5 m), (1.5 m, -2.5 m), (-1.5 m, -2.5 m)]
        location:
            wrt: left.walls[1]
            of: this.walls[3]
            spaced
        walls:
            thickness: 0.1 m

    Entryway door:
        shape: Rectangle width=0.9 m, height=2.0 m
        location:
            in: left.walls[1] and right.walls[3]
            translation: x: 1.0 m, z: 1.0 m

    Window view:
        shape: Rectangle width=1.0 m, height=1.0 m
        location:
            in: left.walls[0]
            translation: z: 1.2 m
"""


@pytest.fixture
def written(tmp_path: Path):
    def write(text: str) -> Path:
        path = tmp_path / "plan.fpm"
        path.write_text(text)
        return path

    return write


def refusal(path: Path) -> str:
    with pytest.raises(DocumentError) as caught:
        lay_out(read_floorplan(path))
    return str(caught.value).removeprefix(str(path))


def test_a_model_is_read_as_written(written) -> None:
    plan = read_floorplan(written(TWO_ROOMS))
    left, right = plan.spaces
    assert left.shape == Rectangle(4.0, 5.0)
    assert isinstance(right.shape, Polygon)
    assert (plan.thickness(left), plan.thickness(right), plan.height(right)) == (0.2, 0.1, 2.5)
    pillar = left.features[0]
    assert (pillar.shape, pillar.height) == (Circle(0.25), 2.0)
    assert pillar.location.rotation == pytest.approx(math.pi / 2)
    assert right.location.spaced
    assert plan.openings[0].walls == [FrameRef("left", 1), FrameRef("right", 3)]
    assert plan.openings[1].location.z == 1.2


def test_what_is_written_is_read_again(written) -> None:
    text = write_floorplan(read_floorplan(written(TWO_ROOMS)))
    assert write_floorplan(read_floorplan(written(text))) == text
    assert "Space right:" in text


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (
            "Space left:",
            "Spacex left:",
            ":11:5: `Spacex` does not fit here\n    Did you mean `Space`?",
        ),
        (
            "width=0.9 m",
            "width=0.9 ft",
            ":36:36: `ft` is not a valid unit here\n    Units are mm, cm",
        ),
        (
            "width=0.9 m",
            "width=",
            ":36:32: `,` does not fit here\n    Expected a number, `-` or a",
        ),
        ("width=0.9 m", "width=-0.9 m", ":36:32: the width must be above 0 m, not -0.9 m"),
        ("radius=0.25 m", "radius=0 m", ":19:38: the radius must be above 0 m"),
        ("thickness: 0.1 m", "thickness: -0.1 m", ":33:24: the thickness of a wall must be above"),
        ("z: 90.0 deg", "z: 90.0 m", ":24:34: an angle in deg or rad is needed here"),
        ("width=wide", "width=broad", ":12:32: there is no variable `broad`"),
        ("Space right:", "Space left:", ":26:5: the name `left` is used twice"),
        ("length=5.0 m", "height=5.0 m", ":12:16: this rectangle must have `width` and `length`"),
        ("wrt: left.walls[1]", "wrt: lift.walls[1]", ":26:5: there is no space `lift`"),
        ("of: this.walls[3]", "of: this.walls[4]", ":26:5: there is no `this.walls[4]`"),
        ("in: left.walls[0]", "in: left.walls[7]", ":41:5: there is no `left.walls[7]`"),
        ("in: left.walls[0]", "in: left.walls[-1]", ":41:5: there is no `left.walls[-1]`"),
        ("wrt: world", "wrt: right", ":26:5: spaces are placed at one another in a circle"),
        ("(1.5 m, -2.5 m), (-1.5 m, -2.5 m)", "(-1.5 m, -2.5 m), (1.5 m, -2.5 m)", "cross one"),
    ],
)
def test_an_error_names_line_and_column(written, old: str, new: str, reason: str) -> None:
    assert TWO_ROOMS.count(old) == 1
    assert reason in refusal(written(TWO_ROOMS.replace(old, new)))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", ":1:1: the file is empty\n    Expected `Floor`."),
        ("Floor plan:", ": the file ends too early\n    Expected a name."),
        ("Floor plan x", ":1:12: `x` does not fit here\n    Expected `:`."),
    ],
)
def test_what_is_no_floor_plan_is_told_in_words(written, text: str, told: str) -> None:
    assert refusal(written(text)).endswith(told)


def test_of_an_unknown_variable_nothing_else_is_told(written) -> None:
    assert refusal(written(TWO_ROOMS.replace("width=wide", "width=broad"))).count("\n") == 1


def test_all_errors_are_reported_together(written) -> None:
    text = TWO_ROOMS.replace("width=0.9 m", "width=-0.9 m").replace("radius=0.25", "radius=-1")
    assert len(refusal(written(text)).splitlines()) == 2


def test_rooms_may_overlap_and_openings_be_wider_than_their_walls(written) -> None:
    text = TWO_ROOMS.replace("            spaced\n", "            translation: y: -1.0 m\n")
    text = text.replace("width=1.0 m, height=1.0", "width=6.0 m, height=1.0")
    layout = lay_out(read_floorplan(written(text)))
    left, right = layout.rooms
    assert left.floor.intersection(right.floor).area == pytest.approx(5.0)
    left_end, _, right_end, _ = layout.openings[1].outline.bounds
    assert right_end - left_end == 6.0


def test_spaces_and_features_may_stand_anywhere_and_in_any_order(written) -> None:
    text = """\
Floor plan: free
    var off = 0.5
    var room = 2 m
    Space room:
        shape: Rectangle width=2, length=room
        location:
            wrt: hall
            of: this
            rotation: z: 90 deg
            translation: y: -off, x: 1
    Space hall:
        shape: Rectangle width=6.0 m, length=5.0 m
        location:
            wrt: world
            of: this
            not aligned
    Divider screen:
        shape: Polygon points:[(0, 0, 0), (1, 0, 0), (1, -1, 0)]
        height: 1
        location:
            wrt: hall.walls[0]
            translation: y: -1
    Window slit:
        shape: Polygon points:[(0, 0, 0), (0, 0, 1), (1, 0, 1)]
        location:
            in: hall.walls[0]
            translation: z: 1
"""
    layout = lay_out(read_floorplan(written(text)))
    room, hall = layout.rooms
    assert (room.frame.x, room.frame.y) == (1.0, -0.5)
    assert room.frame.yaw == pytest.approx(math.pi / 2)
    (screen,) = layout.features
    assert (screen.frame.x, screen.frame.y) == (0.0, 1.5)
    assert layout.openings[0].outline.bounds == (0.0, 1.0, 1.0, 2.0)
    assert hall.space.name == "hall"
    again = write_floorplan(read_floorplan(written(text)))
    assert write_floorplan(read_floorplan(written(again))) == again


def test_walls_of_corners_that_go_counter_clockwise_stand_inside(written) -> None:
    text = """\
Floor plan: inside
    Space box:
        shape: Polygon points:[(0 m, 0 m), (2 m, 0 m), (2 m, 1 m), (0 m, 1 m)]
        location:
            wrt: world
            of: this
    Entryway door:
        shape: Rectangle width=0.4 m, height=1.0 m
        location:
            in: box.walls[0] and box.walls[2]
            translation: x: 0.5 m, z: 0.5 m
"""
    layout = lay_out(read_floorplan(written(text)))
    wall = layout.rooms[0].walls[0]
    assert (wall.frame.x, wall.frame.y, wall.frame.yaw) == (1.0, 0.0, 0.0)
    assert layout.rooms[0].solid.bounds == (0.0, 0.0, 2.0, 1.0)
    assert layout.rooms[0].solid.contains(Point(1.0, 0.1))
    assert not layout.rooms[0].solid.contains(Point(1.0, 0.5))
    left, near, right, far = layout.openings[0].footprint.bounds
    assert (left, right) == pytest.approx((1.3, 1.7))
    assert (near, far) == pytest.approx((0.0, 0.4), abs=0.002)  # both walls' thickness


def test_rooms_are_spaced_and_turned_only_wall_to_wall(written) -> None:
    text = TWO_ROOMS.replace(
        "of: this.walls[3]\n            spaced", "of: this\n            spaced"
    )
    left, right = lay_out(read_floorplan(written(text))).rooms
    assert right.frame == left.walls[1].frame


def test_a_file_without_a_plan(written) -> None:
    assert ":1:1:" in refusal(written("nothing"))
    assert "has no `Space`" in refusal(written("Floor plan: empty\n"))


@pytest.mark.parametrize(("count", "is_valid"), [(50, True), (300, False), (3000, False)])
def test_spaces_are_placed_one_at_another_up_to_a_number(
    count: int, is_valid: bool, written
) -> None:
    spaces = [
        f"Space r{n}:\n    shape: Rectangle width=4 m, length=5 m\n    location:\n"
        f"        wrt: {f'r{n + 1}.walls[1]' if n < count else 'world'}\n        of: this\n"
        for n in range(count + 1)
    ]
    path = written("Floor plan: chain\n" + "".join(spaces))
    if is_valid:
        assert len(lay_out(read_floorplan(path)).rooms) == count + 1
    else:
        assert "more than 100 spaces are placed one at another in a row" in refusal(path)


def test_a_name_fits_into_names_of_files(written) -> None:
    found = refusal(written(TWO_ROOMS.replace("plan: two", f"plan: {'a' * 300}")))
    assert "has 300 characters; names of floor plans have at most 100" in found
