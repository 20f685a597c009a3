"""Makes floor plans with an external generator in a container.

The generator is an image whose entry point takes a model and a folder: `/models/NAME.fpm /output`.
Anywhere below that folder it writes a map as `NAME.yaml` with its image, a mesh as `NAME.stl`, and
the floor plan's graph as `.json` files.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.base.errors import InputError
from robovast.base.file_cache import ContentCache
from robovast.model.expansion.containers import ContainerRunner
from robovast.navigation.floorplan.artefacts import Artefacts
from robovast.navigation.occupancy import map_image, read_resolution

FOLDER = "floorplans"
"""Folder of a generator's files below a configuration's folder; it chooses the names in it."""


def generate(runner: ContainerRunner, model: Path, name: str, root: Path) -> Artefacts:
    """Make the files of a floor plan, or use those made before.

    Args:
        runner: runs the generator's image.
        model: the floor plan (.fpm), which is not read here.
        name: base name of the files.
        root: existing folder; files are written to a folder of the image below it.

    Raises:
        InputError: the generator fails, or a file is missing.
    """
    own = root / hashlib.sha256(runner.digest.encode()).hexdigest()[:12]
    folder = own / FOLDER / name
    if folder.exists():
        return _found(runner.image, own, name)
    folder.mkdir(parents=True)
    cache = ContentCache(name="floorplans")
    key = cache.key([model], runner.digest, name)
    kept = cache.get(key)
    if kept is not None:
        shutil.unpack_archive(kept, folder, "tar")
        return _found(runner.image, own, name)
    target = f"/models/{name}.fpm"
    runner.run([target, "/output"], [f"{model}:{target}:ro", f"{folder}:/output"])
    artefacts = _found(runner.image, own, name)
    with TemporaryDirectory(prefix="robovast-") as scratch:
        cache.put(key, shutil.make_archive(f"{scratch}/made", "tar", folder))
    return artefacts


def _found(image: str, root: Path, name: str) -> Artefacts:
    """The files that the generator has written."""
    folder = root / FOLDER / name
    written = sorted(path for path in folder.rglob("*") if path.is_file())
    map_file = _one(image, written, f"{name}.yaml", "the map")
    mesh = _one(image, written, f"{name}.stl", "the mesh")
    graph = [path for path in written if path.suffix in {".json", ".jsonld"}]
    if not graph:
        raise _missing(image, "*.json", "the graph", written)
    picture = map_image(map_file).resolve()
    if picture not in [path.resolve() for path in written]:
        raise InputError(f"the generator {image}: the image of its map is not below /output.")
    below = root.resolve()

    def name_of(path: Path) -> str:
        return path.resolve().relative_to(below).as_posix()

    return Artefacts(
        root,
        name_of(map_file),
        name_of(picture),
        name_of(mesh),
        tuple(map(name_of, graph)),
        read_resolution(map_file),
    )


def _one(image: str, written: Iterable[Path], name: str, what: str) -> Path:
    found = [path for path in written if path.name == name]
    if len(found) != 1:
        raise _missing(image, name, what, written)
    return found[0]


def _missing(image: str, name: str, what: str, written: Iterable[Path]) -> InputError:
    files = ", ".join(path.name for path in written) or "nothing"
    return InputError(
        f"the generator {image} wrote {files}",
        hint=f"let the generator write {what} as one `{name}` below /output",
    )
