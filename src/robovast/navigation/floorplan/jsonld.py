"""The graph of a floor plan as self-contained JSON-LD."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from shapely.geometry import Polygon as Area

from robovast.navigation.floorplan.layout import (
    PlacedFeature,
    PlacedFloorPlan,
    PlacedOpening,
    Room,
    Wall,
)
from robovast.navigation.poses import Pose

Node = dict[str, Any]

_CONTEXT = {
    "@vocab": "https://purl.org/secorolab/metamodels/environment#",
    "qudt": "http://qudt.org/schema/qudt/",
    "unit": "http://qudt.org/vocab/unit/",
    "xsd": "http://www.w3.org/2001/XMLSchema#",
    "unitOf": {"@id": "qudt:hasUnit", "@type": "@id"},
    **{
        name: {"@type": "@id"}
        for name in ("hasSpace", "hasOpening", "hasFeature", "frame", "asSeenBy", "of", "shape")
    },
    "hasWall": {"@type": "@id", "@container": "@list"},
    "inWall": {"@type": "@id", "@container": "@list"},
    "points": {"@container": "@list"},
}


def documents(layout: PlacedFloorPlan) -> dict[str, str]:
    """The graph in three files by name: elements, coordinates and shapes."""
    parts = {
        "floorplan.json": _elements(layout),
        "coordinate.json": _coordinates(layout),
        "shape.json": _shapes(layout),
    }
    base = f"https://purl.org/robovast/floorplans/{layout.plan.name}/"
    context = {**_CONTEXT, "@base": base}
    return {
        name: json.dumps({"@context": context, "@graph": list(nodes)}, indent=1) + "\n"
        for name, nodes in parts.items()
    }


def _elements(layout: PlacedFloorPlan) -> Iterator[Node]:
    yield {
        "@id": "floorplan",
        "@type": "FloorPlan",
        "name": layout.plan.name,
        "hasSpace": [room.space.name for room in layout.rooms],
        "hasOpening": [placed.opening.name for placed in layout.openings],
    }
    for room in layout.rooms:
        yield _space(room)
        for index, wall in enumerate(room.walls):
            yield _wall(f"{room.space.name}/walls/{index}", wall)
        for feature in room.space.features:
            yield _described(f"{room.space.name}/{feature.name}", feature.kind, feature.height)
    for placed in layout.openings:
        opening = placed.opening
        yield {
            **_described(opening.name, opening.kind, None),
            "inWall": [f"{ref.space}/walls/{ref.wall}" for ref in opening.walls],
        }


def _space(room: Room) -> Node:
    name = room.space.name
    return {
        **_described(name, "Space", None),
        "hasWall": [f"{name}/walls/{index}" for index in range(len(room.walls))],
        "hasFeature": [f"{name}/{feature.name}" for feature in room.space.features],
    }


def _wall(name: str, wall: Wall) -> Node:
    return {
        **_described(name, "Wall", wall.height),
        "length": round(wall.length, 6),
        "thickness": wall.thickness,
    }


def _described(name: str, kind: str, height: float | None) -> Node:
    node = {"@id": name, "@type": kind, "frame": f"{name}/frame", "shape": f"{name}/shape"}
    return node if height is None else {**node, "height": height, "unitOf": "unit:M"}


def _coordinates(layout: PlacedFloorPlan) -> Iterator[Node]:
    yield {"@id": "world", "@type": "Frame"}
    for name, pose in _frames(layout):
        yield {"@id": f"{name}/frame", "@type": "Frame"}
        yield {
            "@id": f"{name}/pose",
            "@type": "PoseCoordinate",
            "of": f"{name}/frame",
            "asSeenBy": "world",
            "unitOf": ["unit:M", "unit:RAD"],
            "x": round(pose.x, 6),
            "y": round(pose.y, 6),
            "theta": round(pose.yaw, 6),
        }


def _frames(layout: PlacedFloorPlan) -> Iterator[tuple[str, Pose]]:
    for room in layout.rooms:
        yield room.space.name, room.frame
        for index, wall in enumerate(room.walls):
            yield f"{room.space.name}/walls/{index}", wall.frame
    for owner, placed in _features(layout):
        yield f"{owner}/{placed.feature.name}", placed.frame
    for opening in layout.openings:
        yield opening.opening.name, opening.frame


def _features(layout: PlacedFloorPlan) -> Iterator[tuple[str, PlacedFeature]]:
    owners = {id(f): room.space.name for room in layout.rooms for f in room.space.features}
    for placed in layout.features:
        yield owners[id(placed.feature)], placed


def _shapes(layout: PlacedFloorPlan) -> Iterator[Node]:
    for room in layout.rooms:
        yield _polygon(room.space.name, "world", room.floor)
        for index, wall in enumerate(room.walls):
            half = wall.length / 2
            corners = [(-half, 0.0), (half, 0.0), (half, wall.thickness), (-half, wall.thickness)]
            name = f"{room.space.name}/walls/{index}"
            yield _polygon(name, f"{name}/frame", Area(corners))
    for owner, placed in _features(layout):
        yield _polygon(f"{owner}/{placed.feature.name}", "world", placed.solid)
    for opening in layout.openings:
        yield _upright(opening)


def _polygon(name: str, frame: str, area: Area) -> Node:
    return {
        "@id": f"{name}/shape",
        "@type": "Polygon",
        "asSeenBy": frame,
        "unitOf": "unit:M",
        "points": [_point(x, y, 0.0) for x, y in area.exterior.coords[:-1]],
    }


def _upright(placed: PlacedOpening) -> Node:
    """The outline of an opening in the plane of its wall."""
    name = placed.opening.name
    points = [_point(x, 0.0, z) for x, z in placed.outline.exterior.coords[:-1]]
    return {**_polygon(name, f"{name}/frame", placed.outline), "points": points}


def _point(x: float, y: float, z: float) -> Node:
    return {"@type": "Point", "x": round(x, 6), "y": round(y, 6), "z": round(z, 6)}
