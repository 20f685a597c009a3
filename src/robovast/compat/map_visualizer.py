"""Draws maps with paths, poses and obstacles in notebooks, using matplotlib (extra `analysis`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.patches import Circle, Rectangle

from robovast.base.errors import InputError
from robovast.navigation.occupancy import OccupancyMap, read_map
from robovast.navigation.sizes import sizes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WHITE, _GREY, _BLACK = 255, 205, 0


class MapVisualizer:
    """A map with results drawn on it: load it, create a figure, draw.

    Attributes:
        map: the map; None until one is loaded.
        fig: the figure; None until it is created.
        ax: its axes, in metres.
    """

    def __init__(self) -> None:
        self.map: OccupancyMap | None = None
        self.fig: Figure | None = None
        self.ax: Axes | None = None

    def load_map(self, yaml_path: str | Path) -> bool:
        """Read a map; print the reason and return False if that fails."""
        try:
            self.map = read_map(Path(yaml_path))
        except InputError as error:
            print(error)  # noqa: T201
            return False
        return True

    def create_figure(
        self, figsize: tuple[float, float] = (12, 10), ax: Axes | None = None
    ) -> tuple[Figure, Axes]:
        """The figure and its axes, with the map when one is loaded.

        Args:
            figsize: width and height [in].
            ax: existing axes to draw on.
        """
        if ax is None:
            self.fig, self.ax = plt.subplots(figsize=figsize)
        else:
            self.fig, self.ax = ax.get_figure(root=True), ax
        axes = self._axes()
        if self.map is not None:
            grey = np.full(self.map.free.shape, _GREY, np.uint8)
            grey[self.map.free] = _WHITE
            grey[self.map.occupied] = _BLACK
            axes.imshow(grey, cmap="gray", vmin=0, vmax=255, origin="lower", extent=self.map.extent)
        axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
        assert self.fig is not None  # noqa: S101  # axes without a figure cannot be made
        return self.fig, axes

    def draw_path(
        self,
        path_points: Iterable[Any],
        color: str = "red",
        linewidth: float = 2.0,
        alpha: float = 0.8,
        label: str = "Path",
        show_endpoints: bool = True,
    ) -> None:
        """Draw a line through points (pairs, or objects with `x` and `y`) and mark its ends."""
        points = [_point(item) for item in path_points]
        axes = self._axes()
        if not points:
            return
        xs, ys = zip(*points, strict=True)
        axes.plot(xs, ys, color=color, linewidth=linewidth, alpha=alpha, label=label)
        if show_endpoints:
            axes.plot(*points[0], "o", color="green", markersize=8)
            axes.plot(*points[-1], "s", color=color, markersize=8)

    def draw_waypoints(
        self,
        waypoints: Iterable[Any],
        color: str = "blue",
        size: float = 8,
        label: str = "Waypoints",
    ) -> None:
        """Numbered points."""
        axes = self._axes()
        for number, point in enumerate(map(_point, waypoints), start=1):
            axes.plot(
                *point, "o", color=color, markersize=size, label=label if number == 1 else None
            )
            axes.annotate(str(number), point, textcoords="offset points", xytext=(5, 5))

    def add_robot_pose(
        self, x: float, y: float, theta: float = 0.0, color: str = "blue", size: float = 0.3
    ) -> None:
        """Draw a robot of this size [m] that looks towards `theta` [rad]."""
        axes = self._axes()
        axes.add_patch(Circle((x, y), size / 2, color=color, alpha=0.6))
        ahead = (x + size * math.cos(theta), y + size * math.sin(theta))
        axes.annotate("", ahead, (x, y), arrowprops={"arrowstyle": "->", "color": color})

    def draw_obstacle(
        self,
        x: float,
        y: float,
        draw_args: Mapping[str, Any] | str,
        yaw: float = 0.0,
        shape: str = "circle",
    ) -> None:
        """Draw an obstacle.

        Args:
            x: x of its centre [m].
            y: y of its centre [m].
            draw_args: `radius` or `diameter` of a circle, `width` and `length` of a box [m], and
                matplotlib's options of patches; or arguments of its model, such as
                `width:=0.5 length:=0.3`.
            yaw: [rad]
            shape: `circle`; anything else means a box.
        """
        given = sizes_of(draw_args) if isinstance(draw_args, str) else draw_args
        style: dict[str, Any] = {"color": "orange", "alpha": 0.7, **given}
        radius = float(style.pop("radius", style.pop("diameter", 0.5) / 2))
        width, length = (
            float(style.pop("width", 2 * radius)),
            float(style.pop("length", 2 * radius)),
        )
        if shape == "circle":
            self._axes().add_patch(Circle((x, y), radius, **style))
            return
        corner = (x - length / 2, y - width / 2)
        self._axes().add_patch(
            Rectangle(
                corner, length, width, angle=math.degrees(yaw), rotation_point="center", **style
            )
        )

    def draw_circle(self, x: float, y: float, radius: float = 0.25, **style: Any) -> None:
        """Draw a circle [m]; `style` contains matplotlib's options of patches."""
        self._axes().add_patch(Circle((x, y), radius, **{"color": "orange", "alpha": 0.7, **style}))

    def draw_obstacles(self, obstacles: Iterable[Mapping[str, Any]]) -> None:
        """Draw obstacles as written by obstacle variations: `spawn_pose`, `xacro_arguments`."""
        for obstacle in obstacles:
            pose = obstacle["spawn_pose"]
            position, yaw = pose["position"], pose.get("orientation", {}).get("yaw", 0.0)
            size = sizes_of(obstacle.get("xacro_arguments", ""))
            shape = "box" if {"width", "length"} & set(size) else "circle"
            self.draw_obstacle(position["x"], position["y"], size, yaw, shape)

    def show_legend(self) -> None:
        """Show a legend."""
        self._axes().legend()

    def save_figure(self, filename: str | Path, dpi: float = 300) -> None:
        """Write the figure to a file."""
        self._axes()
        assert self.fig is not None  # noqa: S101  # it comes with its axes
        self.fig.savefig(filename, dpi=dpi, bbox_inches="tight")

    def get_map_bounds(self) -> tuple[float, float, float, float]:
        """Smallest x, largest x, smallest y, largest y of the map [m]."""
        return self._map().extent

    def pixel_to_world(self, px: float, py: float) -> tuple[float, float]:
        """The point of a pixel of the map's image, from its upper left corner [m]."""
        found = self._map()
        rows = found.free.shape[0]
        x, y = found.origin
        return x + px * found.resolution, y + (rows - py) * found.resolution

    def world_to_pixel(self, x: float, y: float) -> tuple[int, int]:
        """The pixel of the map's image at a point [m], from its upper left corner."""
        found = self._map()
        rows = found.free.shape[0]
        left, bottom = found.origin
        column = math.floor((x - left) / found.resolution)
        return column, rows - math.floor((y - bottom) / found.resolution)

    def _axes(self) -> Axes:
        if self.ax is None:
            raise ValueError("there is no figure yet: call create_figure() first")
        return self.ax

    def _map(self) -> OccupancyMap:
        if self.map is None:
            raise ValueError("there is no map yet: call load_map() first")
        return self.map


def _point(item: Any) -> tuple[float, float]:
    """A pair, a mapping with `x` and `y` (also below `position`), or an object with them."""
    if isinstance(item, Mapping):
        inside = item.get("position", item)
        return float(inside["x"]), float(inside["y"])
    if isinstance(item, Sequence | np.ndarray):
        return float(item[0]), float(item[1])
    return float(item.x), float(item.y)
