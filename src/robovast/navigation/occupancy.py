"""Occupancy maps in the format of ROS map_server; `map_files` lists what is supported."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.navigation.map_files import (
    Description,
    Grid,
    cells_of,
    parse_description,
    read_description,
    read_pixels,
)
from robovast.navigation.poses import Point

Mask = np.ndarray[tuple[int, int], np.dtype[np.bool_]]

FREE, UNKNOWN, OCCUPIED = 254, 205, 0
"""Grey values in the images of map savers."""

_OCCUPIED_THRESH, _FREE_THRESH = 0.65, 0.196


@dataclass(frozen=True)
class OccupancyMap:
    """Free and occupied cells; all others are unknown.

    Row 0 is the lowest: rows grow with y, columns with x.
    """

    free: Mask
    """Shape (rows, columns)."""
    occupied: Mask
    """Shape (rows, columns)."""
    resolution: float
    """Edge length of a cell [m]."""
    origin: Point = (0.0, 0.0)
    """Lower left corner of cell (0, 0) [m]."""

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Least x, largest x, least y, largest y [m]."""
        rows, columns = self.free.shape
        x, y = self.origin
        return x, x + columns * self.resolution, y, y + rows * self.resolution

    def cell(self, point: Point) -> tuple[float, float]:
        """Row and column of a point, as fractions: the centre of cell (0, 0) is (0.0, 0.0)."""
        x, y = self.origin
        return (point[1] - y) / self.resolution - 0.5, (point[0] - x) / self.resolution - 0.5

    def point(self, row: float, column: float) -> Point:
        """The point at a row and a column."""
        x, y = self.origin
        return x + (column + 0.5) * self.resolution, y + (row + 0.5) * self.resolution


def read_map(path: Path) -> OccupancyMap:
    """Read a map.

    Raises:
        InputError: the YAML file or its image is missing or invalid; the message names the key.
    """
    description = read_description(path)
    pixels = read_pixels(path.parent / description.image, str(path))
    return _occupancy(description, cells_of(description, pixels, str(path)))


def decode_map(description: bytes, pixels: bytes, name: str, most: int) -> OccupancyMap:
    """Decode a map.

    Args:
        description: content of the YAML file.
        pixels: content of the image.
        name: the map's name for messages.
        most: largest number of cells.

    Raises:
        InputError: as in `read_map`, or the map is too large.
    """
    found = parse_description(description, name)
    return _occupancy(found, cells_of(found, pixels, name, most))


def _occupancy(description: Description, cells: Grid) -> OccupancyMap:
    rows = np.flipud(cells)
    origin = (description.x, description.y)
    return OccupancyMap(rows == 0, rows == 100, description.resolution, origin)


def map_image(path: Path) -> Path:
    """Path of the image in a map's YAML file.

    Raises:
        InputError: the file is not a map, or the image is missing.
    """
    image = path.parent / read_description(path).image
    if not image.is_file():
        raise InputError(
            f"the map {path}: its image {image} does not exist.",
            hint="correct `image`, which is relative to the YAML file",
        )
    return image


def read_resolution(path: Path) -> float:
    """The resolution of a map [m].

    Raises:
        InputError: the file is not a map.
    """
    return read_description(path).resolution


def write_map(occupancy: OccupancyMap, path: Path) -> Path:
    """Write a map as YAML, and its image as PGM beside it.

    Args:
        occupancy: the map.
        path: the YAML file.

    Returns:
        Path of the image.
    """
    grey = np.full(occupancy.free.shape, UNKNOWN, np.uint8)
    grey[occupancy.free] = FREE
    grey[occupancy.occupied] = OCCUPIED
    image = path.with_suffix(".pgm")
    rows, columns = occupancy.free.shape
    header = f"P5\n{columns} {rows}\n255\n"
    image.write_bytes(header.encode() + np.flipud(grey).tobytes())
    data = {
        "image": image.name,
        "mode": "trinary",
        "resolution": occupancy.resolution,
        "origin": [*occupancy.origin, 0.0],
        "negate": 0,
        "occupied_thresh": _OCCUPIED_THRESH,
        "free_thresh": _FREE_THRESH,
    }
    path.write_text(dump_yaml(data), encoding="utf-8")
    return image
