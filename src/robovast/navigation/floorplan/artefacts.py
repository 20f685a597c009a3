"""Writes all files made from a floor plan: map, mesh and graph."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from robovast.navigation.floorplan.jsonld import documents
from robovast.navigation.floorplan.layout import lay_out
from robovast.navigation.floorplan.mesh import mesh_of, to_stl
from robovast.navigation.floorplan.model import FloorPlan
from robovast.navigation.floorplan.render import RESOLUTION, render
from robovast.navigation.occupancy import write_map

MAPS, MESHES, GRAPHS = "maps", "3d-mesh", "json-ld"
"""Folder of all plans' files below a configuration's folder."""


@dataclass(frozen=True)
class Artefacts:
    """Files of a floor plan, relative to `root`."""

    root: Path
    map_file: str
    image: str
    mesh_file: str
    graph: tuple[str, ...]
    resolution: float
    """Resolution of the map [m]."""

    @property
    def files(self) -> list[tuple[str, str]]:
        """Pairs of relative names and absolute paths."""
        names = (self.map_file, self.image, self.mesh_file, *self.graph)
        return [(name, str(self.root / name)) for name in names]


def make_artefacts(plan: FloorPlan, name: str, root: Path) -> Artefacts:
    """Write the files of a plan.

    Args:
        plan: the plan.
        name: base name of the files.
        root: existing folder; files are written to MAPS, MESHES and GRAPHS below it.

    Raises:
        DocumentError: the plan is invalid.
    """
    layout = lay_out(plan)
    graph_folder = f"{GRAPHS}/{name}"
    for folder in (MAPS, MESHES, graph_folder):
        (root / folder).mkdir(parents=True, exist_ok=True)
    map_file, mesh_file = f"{MAPS}/{name}.yaml", f"{MESHES}/{name}.stl"
    image = write_map(render(layout), root / map_file)
    (root / mesh_file).write_bytes(to_stl(mesh_of(layout)))
    graph = documents(layout)
    for file, text in graph.items():
        (root / graph_folder / file).write_text(text, encoding="utf-8")
    return Artefacts(
        root,
        map_file,
        f"{MAPS}/{image.name}",
        mesh_file,
        tuple(f"{graph_folder}/{file}" for file in graph),
        RESOLUTION,
    )
