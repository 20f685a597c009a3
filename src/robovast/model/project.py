"""The project file: which .vast file the commands in a folder, and below it, are about."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ValidationError

from robovast.base.atomic import write_atomically
from robovast.base.errors import DocumentError, InputError, StorageError
from robovast.base.serialization import dump_yaml
from robovast.model.document.model import Section
from robovast.model.document.problems import nearest, problems_of
from robovast.model.document.source import Source

PROJECT_FILE = ".robovast_project"

Level = Literal["debug", "info", "warning", "error", "critical"]
"""How much is told, in any case of letters."""


def _lower(value: object) -> object:
    return value.lower() if isinstance(value, str) else value


class ProjectFile(Section):
    """Content of the project file; paths are relative to its folder."""

    config: str
    """The .vast file."""
    results_dir: str = "results"
    """Where campaigns and their results go."""
    log_level: Annotated[Level, BeforeValidator(_lower)] | None = None
    """Log level of every command in the project."""


@dataclass(frozen=True)
class Project:
    """A folder whose commands know their .vast file."""

    root: Path
    """Folder of the project file."""
    vast_file: Path
    """Absolute path."""
    results_dir: Path
    """Absolute path; need not exist."""
    log_level: str | None
    """Log level of every command in the project."""


def find_project(folder: Path) -> Project | None:
    """The project that a folder belongs to: the nearest at or above it.

    Raises:
        InputError: its file cannot be read.
        DocumentError: what is wrong in it.
    """
    folder = folder.absolute()
    for root in (folder, *folder.parents):
        if (root / PROJECT_FILE).is_file():
            return _read(root)
    return None


def create_project(
    root: Path, vast_file: Path, results_dir: Path, log_level: str | None, *, force: bool
) -> Path:
    """Write a project file; returns its path.

    Args:
        root: folder of the project.
        vast_file: must exist.
        results_dir: need not exist.
        log_level: None leaves it to each command.
        force: replace a project file that is there.

    Raises:
        InputError: no such .vast file, or the folder is a project already.
        StorageError: the file cannot be written.
    """
    path = root.absolute() / PROJECT_FILE
    if not vast_file.is_file():
        raise InputError(f"{vast_file}: there is no such file.")
    if path.exists() and not force:
        raise InputError(f"{path} exists already; `--force` replaces it.")
    data = {
        "config": _relative(vast_file, path.parent),
        "results_dir": _relative(results_dir, path.parent),
        **({"log_level": log_level} if log_level else {}),
    }
    try:
        write_atomically(path, dump_yaml(data))
    except OSError as error:
        raise StorageError(f"{path}: cannot be written: {error.strerror}.") from error
    return path


def _read(root: Path) -> Project:
    source = Source.read(root / PROJECT_FILE)
    if not isinstance(source.data, dict):
        raise DocumentError(
            [source.problem((), "a project file is a mapping", "`vast init --force CONFIG`")]
        )
    try:
        file = ProjectFile.model_validate(_without_unknown(source.data))
    except ValidationError as error:
        raise DocumentError(problems_of(error, source, ProjectFile)) from error
    return Project(root, root / file.config, root / file.results_dir, file.log_level)


def _without_unknown(data: dict[Any, Any]) -> dict[Any, Any]:
    """Without keys that nobody reads, unless one looks like a missing one, misspelt."""
    known = ProjectFile.model_fields
    missing = [name for name in known if name not in data]
    return {key: v for key, v in data.items() if key in known or nearest(str(key), missing)}


def _relative(path: Path, root: Path) -> str:
    absolute = path.absolute()
    return str(absolute.relative_to(root) if absolute.is_relative_to(root) else absolute)
