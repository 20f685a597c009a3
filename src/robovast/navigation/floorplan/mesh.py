"""The mesh of a floor plan, as STL."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import manifold3d
import numpy as np
import numpy.typing as npt
from shapely.geometry.base import BaseGeometry

from robovast.navigation.floorplan.layout import PlacedFloorPlan, PlacedOpening
from robovast.navigation.floorplan.render import rings

Solid = Any
"""A manifold3d.Manifold, whose package has no types."""

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def mesh_of(layout: PlacedFloorPlan) -> Solid:
    """Walls with their openings, columns and dividers, as one closed solid [m]."""
    walls = _union(_extruded(room.solid, room.height) for room in layout.rooms)
    holes = _union(_hole(placed) for placed in layout.openings)
    features = (_extruded(placed.solid, placed.feature.height) for placed in layout.features)
    return _union([walls - holes, *features])


def to_stl(solid: Solid) -> bytes:
    """A solid as binary STL; equal solids give equal bytes."""
    mesh = solid.to_mesh()
    corners = np.asarray(mesh.vert_properties, np.float32)[:, :3][np.asarray(mesh.tri_verts)]
    facets = np.zeros(len(corners), _FACET)
    facets["corners"] = corners
    facets["normal"] = _normals(corners)
    return bytes(80) + np.uint32(len(facets)).tobytes() + facets.tobytes()


def _normals(corners: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return (normals / np.where(lengths > 0, lengths, 1)).astype(np.float32)


def _extruded(area: BaseGeometry, height: float) -> Solid:
    outlines = [ring[:-1] for ring in rings(area)]
    return manifold3d.CrossSection(outlines, manifold3d.FillRule.EvenOdd).extrude(height)


def _hole(placed: PlacedOpening) -> Solid:
    """The volume of an opening: its outline, from the far side of the wall to the near side."""
    solid = _extruded(placed.outline, placed.far - placed.near)
    cos, sin = math.cos(placed.frame.yaw), math.sin(placed.frame.yaw)
    x = placed.frame.x - sin * placed.far
    y = placed.frame.y + cos * placed.far
    return solid.transform(np.array([[cos, 0, sin, x], [sin, 0, -cos, y], [0, 1, 0, 0]]))


def _union(solids: Iterable[Solid]) -> Solid:
    return manifold3d.Manifold.batch_boolean(list(solids), manifold3d.OpType.Add)
