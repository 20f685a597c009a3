"""Occupancy maps in the format of ROS map_server: a YAML file and a PGM or PNG image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, UnidentifiedImageError

from robovast.base.errors import InputError
from robovast.base.serialization import dump_yaml
from robovast.base.yaml_files import parse_yaml
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
    data = _read_yaml(path)
    resolution = _positive(path, data, "resolution")
    origin = _origin(path, data)
    grey, known = _read_image(path, data)
    darkness = grey if data.get("negate") in (1, True) else 1.0 - grey
    occupied = known & (darkness > float(data.get("occupied_thresh", _OCCUPIED_THRESH)))
    free = known & (darkness < float(data.get("free_thresh", _FREE_THRESH)))
    return OccupancyMap(np.flipud(free), np.flipud(occupied), resolution, origin)


def map_image(path: Path) -> Path:
    """Path of the image in a map's YAML file.

    Raises:
        InputError: the file is not a map, or the image is missing.
    """
    return _image_path(path, _read_yaml(path))


def read_resolution(path: Path) -> float:
    """The resolution of a map [m].

    Raises:
        InputError: the file is not a map.
    """
    return _positive(path, _read_yaml(path), "resolution")


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


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        data = parse_yaml(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"there is no map {path}.") from None
    except (OSError, ValueError) as error:
        raise InputError(f"the map {path} cannot be read: {error}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} is no map: it must be a mapping with `image` and `resolution`.")
    return data


def _positive(path: Path, data: dict[str, Any], key: str) -> float:
    value = data.get(key)
    if isinstance(value, int | float) and math.isfinite(value) and value > 0:
        return float(value)
    raise InputError(f"the map {path}: `{key}` must be a number above 0, not {value!r}.")


def _origin(path: Path, data: dict[str, Any]) -> Point:
    value = data.get("origin", [0.0, 0.0, 0.0])
    match value:
        case [int() | float() as x, int() | float() as y, *rest] if not any(rest):
            return float(x), float(y)
    raise InputError(
        f"the map {path}: `origin` must be `[x, y, 0.0]`, not {value!r}; a rotated map is not "
        "supported, as in most of Nav2."
    )


def _image_path(path: Path, data: dict[str, Any]) -> Path:
    name = data.get("image")
    if not isinstance(name, str) or not name:
        raise InputError(f"the map {path}: `image` must name an image file.")
    image = path.parent / name
    if not image.is_file():
        raise InputError(f"the map {path}: its image {image} does not exist.")
    return image


def _read_image(path: Path, data: dict[str, Any]) -> tuple[npt.NDArray[np.float64], Mask]:
    """Brightness from 0 to 1, and a mask of known cells.

    The grey of unknown cells means unknown whatever the thresholds: Nav2 saves maps with a
    `free_thresh` of 0.25, by which everything outside the building would be free.
    """
    image = _image_path(path, data)
    try:
        with Image.open(image) as file:
            bands = np.asarray(file.convert("LA"))
    except (OSError, UnidentifiedImageError, ValueError) as error:
        raise InputError(f"the map {path}: its image {image} cannot be read: {error}") from error
    grey, opacity = bands[..., 0], bands[..., 1]
    unknown = (grey == UNKNOWN) & (data.get("mode", "trinary") == "trinary")
    return grey / 255.0, (opacity > 127) & ~unknown
