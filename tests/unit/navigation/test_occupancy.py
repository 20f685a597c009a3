"""Maps as map_server reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from robovast.base.errors import InputError
from robovast.navigation.occupancy import OccupancyMap, read_map, write_map

GREYS = np.array([[0, 100, 205], [254, 255, 220]], np.uint8)
TEXT = "image: map.png\nresolution: 0.1\norigin: [-1.0, 2.0, 0.0]\nfree_thresh: 0.25\n"


@pytest.fixture
def written(tmp_path: Path):
    def write(text: str = TEXT, image: Image.Image | None = None) -> Path:
        (image or Image.fromarray(GREYS)).save(tmp_path / "map.png")
        path = tmp_path / "map.yaml"
        path.write_text(text)
        return path

    return write


def test_grey_is_free_occupied_or_unknown(written) -> None:
    occupancy = read_map(written())
    assert occupancy.free.tolist() == [[True, True, True], [False, False, False]]
    assert occupancy.occupied.tolist() == [[False, False, False], [True, False, False]]


def test_thresholds_negation_and_transparency(written) -> None:
    assert read_map(written(TEXT + "occupied_thresh: 0.5\n")).occupied.sum() == 2
    negated = read_map(written(TEXT + "negate: 1\n"))
    assert negated.occupied.tolist()[0] == [True, True, True]
    image = Image.fromarray(GREYS).convert("LA")
    image.putpixel((0, 1), (254, 0))
    assert read_map(written(image=image)).free.tolist()[0] == [False, True, True]


def test_places_follow_from_origin_and_resolution(written) -> None:
    occupancy = read_map(written())
    assert occupancy.point(0, 0) == pytest.approx((-0.95, 2.05))
    assert occupancy.cell((-0.95, 2.15)) == pytest.approx((1.0, 0.0))
    assert occupancy.extent == pytest.approx((-1.0, -0.7, 2.0, 2.2))


def test_a_written_map_is_read_again(tmp_path: Path) -> None:
    free = np.zeros((4, 5), bool)
    free[1:3, 1:4] = True
    occupied = np.zeros((4, 5), bool)
    occupied[0] = True
    write_map(OccupancyMap(free, occupied, 0.05, (1.5, -2.0)), tmp_path / "map.yaml")
    again = read_map(tmp_path / "map.yaml")
    assert (again.free == free).all()
    assert (again.occupied == occupied).all()
    assert (again.resolution, again.origin) == (0.05, (1.5, -2.0))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("image: none.pgm\nresolution: 0.1\n", "its image .*none.pgm does not exist"),
        ("resolution: 0.1\n", "`image` must name an image file"),
        (TEXT.replace("0.1", "-0.1"), "`resolution` must be a number above 0, not -0.1"),
        (TEXT.replace("0.0]", "1.57]"), "a rotated map is not supported"),
        (TEXT.replace("map.png", "map.yaml"), "its image .*map.yaml cannot be read"),
        ("[1, 2]", "is not a valid map"),
        ("image: [", "cannot be read"),
    ],
)
def test_wrong_maps(written, text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        read_map(written(text))
