"""Everything that is made of a floor plan: map, mesh and graph, as files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from robovast.navigation.floorplan.jsonld import documents
from robovast.navigation.floorplan.layout import lay_out
from robovast.navigation.floorplan.mesh import mesh_of, to_stl
from robovast.navigation.floorplan.model import FloorPlan
from robovast.navigation.floorplan.render import RESOLUTION, render
from robovast.navigation.occupancy import write_map

FOLDER = "floorplans"
"""Where the files of all plans are, below a configuration's folder."""


@dataclass(frozen=True)
class Artefacts:
    """Files of a floor plan, relative to `root`."""

    root: Path
    map_file: str
    image: str
    mesh_file: str
    graph: tuple[str, ...]
    resolution: float
    """Of the map [m]."""

    @property
    def files(self) -> list[tuple[str, str]]:
        """Pairs of relative names and absolute paths."""
        names = (self.map_file, self.image, self.mesh_file, *self.graph)
        return [(name, str(self.root / name)) for name in names]


def make_artefacts(plan: FloorPlan, name: str, root: Path) -> Artefacts:
    """Write the files of a plan.

    Args:
        plan: the plan.
        name: of the files.
        root: existing folder; the files go into `floorplans/<name>` below it.

    Raises:
        DocumentError: the plan is not sound.
    """
    layout = lay_out(plan)
    folder = root / FOLDER / name
    folder.mkdir(parents=True, exist_ok=True)
    image = write_map(render(layout), folder / f"{name}.yaml")
    (folder / f"{name}.stl").write_bytes(to_stl(mesh_of(layout)))
    graph = documents(layout)
    for file, text in graph.items():
        (folder / file).write_text(text, encoding="utf-8")
    below = f"{FOLDER}/{name}"
    return Artefacts(
        root,
        f"{below}/{name}.yaml",
        f"{below}/{image.name}",
        f"{below}/{name}.stl",
        tuple(f"{below}/{file}" for file in graph),
        RESOLUTION,
    )
