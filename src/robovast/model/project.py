"""The project file: it names the .vast file that commands use in its folder and below."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError
from pydantic_core import PydanticCustomError

from robovast.base.atomic import write_atomically
from robovast.base.errors import DocumentError, InputError
from robovast.base.file_errors import writing
from robovast.base.serialization import dump_yaml
from robovast.base.trusted_files import find_above
from robovast.model.document.problems import nearest, problems_of
from robovast.model.document.section import Section
from robovast.model.document.source import Source

PROJECT_FILE = ".robovast_project"

Level = Literal["debug", "info", "warning", "error", "critical"]
"""Log levels, in upper or lower case."""


def _lower(value: object) -> object:
    return value.lower() if isinstance(value, str) else value


def _path(value: str) -> str:
    """Refuse a path that no file can have.

    Raises:
        PydanticCustomError: it is one.
    """
    if "\0" in value or any(len(os.fsencode(name)) > 255 for name in value.split("/")):
        raise PydanticCustomError("path", "is not a path: it has a NUL character or a long name")
    return value


FilePath = Annotated[str, Field(max_length=4000), AfterValidator(_path)]


class ProjectFile(Section):
    """Content of the project file; paths are relative to its folder."""

    config: FilePath
    """The .vast file."""
    results_dir: FilePath = "results"
    """Folder of campaigns and their results."""
    log_level: Annotated[Level, BeforeValidator(_lower)] | None = None
    """Log level of every command in the project."""


@dataclass(frozen=True)
class Project:
    """A folder with a project file."""

    root: Path
    """Folder of the project file."""
    vast_file: Path
    """Absolute path."""
    results_dir: Path
    """Absolute path of the results; need not exist."""
    log_level: str | None
    """Log level of every command in the project."""


def find_project(folder: Path) -> Project | None:
    """The project of a folder: the nearest one at or above it.

    Raises:
        InputError: the project file cannot be read.
        DocumentError: all problems of the project file.
    """
    path = find_above(folder, PROJECT_FILE)
    return _read(path.parent) if path is not None else None


def create_project(
    root: Path, vast_file: Path, results_dir: Path, log_level: str | None, *, force: bool
) -> Path:
    """Write a project file and return its path.

    Args:
        root: folder of the project.
        vast_file: the .vast file; it must exist.
        results_dir: folder of results; it need not exist.
        log_level: log level of all commands; None leaves it to each command.
        force: replace an existing project file.

    Raises:
        InputError: the .vast file is missing, or the folder already has a project file.
        StorageError: the file cannot be written.
    """
    path = root.absolute() / PROJECT_FILE
    if not os.path.isfile(vast_file):
        raise InputError(
            f"{vast_file}: there is no such file.",
            hint="write the file as in docs/tutorials/own-robot.md, or copy an example from "
            "configs/examples",
        )
    if os.path.exists(path) and not force:
        raise InputError(f"{path} exists already", hint="use `--force` to replace it")
    data = {
        "config": _relative(vast_file, path.parent),
        "results_dir": _relative(results_dir, path.parent),
        **({"log_level": log_level} if log_level else {}),
    }
    with writing(path):
        write_atomically(path, dump_yaml(data))
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
    """Drop unknown keys, except those that look like a misspelt missing key."""
    known = ProjectFile.model_fields
    missing = [name for name in known if name not in data]
    return {key: v for key, v in data.items() if key in known or nearest(str(key), missing)}


def _relative(path: Path, root: Path) -> str:
    absolute = path.absolute()
    return str(absolute.relative_to(root) if absolute.is_relative_to(root) else absolute)
