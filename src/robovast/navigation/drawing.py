"""Draws a configuration: map, start, goals, path, obstacles."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from robovast.navigation.obstacle_boxes import corners, obstacle_boxes
from robovast.navigation.occupancy import OccupancyMap
from robovast.navigation.poses import Point, Pose, read_pose

_WALL, _FLOOR, _OUTSIDE = (40, 40, 40), (255, 255, 255), (225, 225, 225)
_PATH, _START, _GOAL, _OBSTACLE = "#2563eb", "#15803d", "#b91c1c", "#ea580c"

PIXELS = 800
"""Longer side of a picture [pixels]."""


@dataclass(frozen=True)
class Line:
    """A polyline on the map."""

    points: Sequence[Point]
    colour: str
    width: int = 3
    """[pixels]"""


@dataclass(frozen=True)
class Disc:
    """A disc on the map."""

    centre: Point
    radius: float
    """[m]"""
    colour: str
    label: str = ""


@dataclass(frozen=True)
class Area:
    """A filled polygon on the map."""

    corners: Sequence[Point]
    colour: str


Mark = Line | Disc | Area


def marks(record: Mapping[str, Any], parameters: Mapping[str, Any] | None = None) -> Iterator[Mark]:
    """Marks for the records of navigation variations, in drawing order.

    Args:
        record: what the variations have recorded.
        parameters: of the scenario, which tell the shapes of obstacles (default: all are discs).
    """
    boxes = obstacle_boxes(parameters or {})
    for obstacle in record.get("obstacles") or ():
        place = (obstacle["x"], obstacle["y"])
        if place in boxes:
            yield Area(corners(boxes[place]), _OBSTACLE)
        else:
            yield Disc(place, obstacle["radius"], _OBSTACLE)
    if record.get("path"):
        yield Line([(x, y) for x, y in record["path"]], _PATH)
    radius = float(record.get("robot_diameter", 0.35)) / 2
    for number, goal in enumerate(record.get("goals") or (), start=1):
        yield from _pose(read_pose(goal), radius, _GOAL, str(number))
    if record.get("start"):
        yield from _pose(read_pose(record["start"]), radius, _START, "S")


def to_svg(occupancy: OccupancyMap, found: Sequence[Mark], title: str) -> str:
    """The picture as SVG with the map embedded; browsers show its title."""
    paper = _Paper(occupancy)
    buffer = io.BytesIO()
    _image(occupancy).save(buffer, "PNG", optimize=True)
    data = base64.b64encode(buffer.getvalue()).decode()
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{paper.width}" height="{paper.height}"'
        f' viewBox="0 0 {paper.width} {paper.height}">',
        f"<title>{escape(title)}</title>",
        f'<image width="{paper.width}" height="{paper.height}" image-rendering="pixelated"'
        f' href="data:image/png;base64,{data}"/>',
        *(_svg(mark, paper) for mark in found),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def to_png(occupancy: OccupancyMap, found: Sequence[Mark], title: str) -> bytes:
    """The picture as PNG; its title is stored in the file."""
    from PIL.PngImagePlugin import PngInfo

    paper = _Paper(occupancy)
    size = (paper.width, paper.height)
    image = _image(occupancy).resize(size, Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(image)
    for mark in found:
        _draw(mark, paper, draw)
    buffer, about = io.BytesIO(), PngInfo()
    about.add_text("Title", title)
    image.save(buffer, "PNG", pnginfo=about)
    return buffer.getvalue()


def _draw(mark: Mark, paper: _Paper, draw: ImageDraw.ImageDraw) -> None:
    match mark:
        case Line(points, colour, width):
            draw.line([paper.at(point) for point in points], colour, width, joint="curve")
        case Area(ends, colour):
            draw.polygon([paper.at(point) for point in ends], colour)
        case Disc(centre, radius, colour, label):
            draw.circle(paper.at(centre), paper.length(radius), colour)
            draw.text(paper.at(centre), label, "white", anchor="mm")


def _pose(pose: Pose, radius: float, colour: str, label: str) -> Iterator[Mark]:
    """The robot's disc, and a line for its heading."""
    tip = (pose.x + 2 * radius * math.cos(pose.yaw), pose.y + 2 * radius * math.sin(pose.yaw))
    yield Line([pose.point, tip], colour)
    yield Disc(pose.point, radius, colour, label)


class _Paper:
    """Pixel coordinates of a picture, whose y axis points down."""

    def __init__(self, occupancy: OccupancyMap) -> None:
        x0, x1, y0, y1 = occupancy.extent
        self._left, self._top = x0, y1
        self._scale = PIXELS / max(x1 - x0, y1 - y0)
        self.width = max(1, round((x1 - x0) * self._scale))
        self.height = max(1, round((y1 - y0) * self._scale))

    def at(self, point: Point) -> Point:
        """Pixel of a point."""
        x, y = (point[0] - self._left) * self._scale, (self._top - point[1]) * self._scale
        return round(x, 1), round(y, 1)

    def length(self, metres: float) -> float:
        """A length in pixels, large enough to be visible."""
        return round(max(metres * self._scale, 3.0), 1)


def _image(occupancy: OccupancyMap) -> Image.Image:
    """The map, one pixel per cell."""
    pixels = np.full((*occupancy.free.shape, 3), _OUTSIDE, np.uint8)
    pixels[occupancy.free] = _FLOOR
    pixels[occupancy.occupied] = _WALL
    return Image.fromarray(np.flipud(pixels))


def _svg(mark: Mark, paper: _Paper) -> str:
    if isinstance(mark, Line):
        points = " ".join(f"{x},{y}" for x, y in map(paper.at, mark.points))
        return (
            f'<polyline points="{points}" fill="none" stroke="{mark.colour}"'
            f' stroke-width="{mark.width}" stroke-linejoin="round"/>'
        )
    if isinstance(mark, Area):
        points = " ".join(f"{x},{y}" for x, y in map(paper.at, mark.corners))
        return f'<polygon points="{points}" fill="{mark.colour}"/>'
    x, y = paper.at(mark.centre)
    radius = paper.length(mark.radius)
    disc = f'<circle cx="{x}" cy="{y}" r="{radius}" fill="{mark.colour}"/>'
    if not mark.label:
        return disc
    return (
        f'{disc}<text x="{x}" y="{y}" fill="white" font-family="sans-serif"'
        f' font-size="{round(1.2 * radius, 1)}" text-anchor="middle"'
        f' dominant-baseline="central">{escape(mark.label)}</text>'
    )
