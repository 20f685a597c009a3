"""Reads .vast documents and reports all problems of a file at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from robovast.base.errors import DocumentError, Problem
from robovast.model.document.checks import check_parts, warnings_of
from robovast.model.document.declared import apply_types
from robovast.model.document.execution import Execution
from robovast.model.document.ignored import without_ignored
from robovast.model.document.model import ConfigurationEntry, Vast
from robovast.model.document.other_format import problem_of
from robovast.model.document.parts import Parts
from robovast.model.document.problems import problems_of
from robovast.model.document.search.section import Search
from robovast.model.document.source import KeyPath, Source

ModelT = TypeVar("ModelT", bound=BaseModel)


@dataclass(frozen=True)
class Document:
    """A valid .vast document and its origin."""

    path: Path
    """Absolute path of the file."""
    vast: Vast
    """The validated model."""
    source: Source
    """The plain data, with the position of every value."""
    warnings: tuple[Problem, ...] = ()
    """Keys and values that have no effect."""

    @property
    def folder(self) -> Path:
        """The file's folder; paths in the document are relative to it."""
        return self.path.parent

    @property
    def scenario(self) -> Path:
        """Absolute path of the scenario file."""
        assert self.vast.scenario_file is not None, "checked when the document was loaded"  # noqa: S101
        return self.folder / self.vast.scenario_file


def load_document(path: Path, *, search: bool = True) -> Document:
    """Read and check a .vast file and the files that it names.

    Args:
        path: the file, relative to the working directory or absolute.
        search: also load the plugins of its search; False where nothing is proposed.

    Raises:
        InputError: the file cannot be read.
        DocumentError: all problems of its content, with line and column.
    """
    return check_source(Source.read(path), search=search)


def check_source(source: Source, *, search: bool = True) -> Document:
    """Check a document's text, which may not be written to a file yet; see `load_document`.

    Raises:
        DocumentError: all its problems.
    """
    apply_types(source)
    if not isinstance(source.data, dict):
        found = "empty" if source.data is None else f"a {type(source.data).__name__}"
        raise DocumentError(
            [source.problem((), f"a .vast file is a mapping of sections; this one is {found}")]
        )
    if found_format := problem_of(source):
        raise DocumentError([found_format])
    data, warnings = without_ignored(source)
    vast, problems = _validate(Vast, data, source, ())
    path = source.file.absolute()
    searched = vast.search if vast and search else None
    if vast is not None and data is source.data:
        entries = dict(enumerate(vast.configuration or ()))
        parts = Parts(path.parent, source, entries, vast.execution, searched)
    else:
        parts = _valid_parts(source, path, searched)
    problems += [*check_parts(parts), *_search_problems(parts)]
    if vast is None or problems:
        raise DocumentError(problems)
    return Document(path, vast, source, (*warnings, *warnings_of(parts), *_search_warnings(parts)))


def _search_problems(parts: Parts) -> list[Problem]:
    if parts.search is None:
        return []
    from robovast.model.document.search.checks import check_search  # which each pod would import

    return check_search(parts, parts.search)


def _search_warnings(parts: Parts) -> Iterator[Problem]:
    if parts.search is not None:
        from robovast.model.document.search.checks import search_warnings

        yield from search_warnings(parts, parts.search)


def _validate(
    model: type[ModelT], data: Any, source: Source, base: KeyPath
) -> tuple[ModelT | None, list[Problem]]:
    try:
        return model.model_validate(data), []
    except ValidationError as error:
        return None, problems_of(error, source, model, base)


def _valid_parts(source: Source, path: Path, search: Search | None) -> Parts:
    """The parts that can be checked further although other parts of the document are wrong."""
    entries = source.data.get("configuration")
    valid = {}
    for index, entry in enumerate(entries if isinstance(entries, list) else []):
        model = _salvage(ConfigurationEntry, entry, {"name": f"entry-{index}"})
        if model is not None:
            valid[index] = model
    execution = _salvage(Execution, source.data.get("execution") or {}, {})
    return Parts(path.parent, source, valid, execution, search)


def _salvage(model: type[ModelT], data: Any, required: dict[str, Any]) -> ModelT | None:
    """The valid part of a section, without its invalid keys.

    Args:
        model: the section's model.
        data: the section's data.
        required: substitutes for required keys.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        if not isinstance(data, dict):
            return None
        wrong = {details["loc"][0] for details in error.errors() if details["loc"]}
        rest = {key: value for key, value in data.items() if key not in wrong}
    try:
        return model.model_validate(required | rest)
    except ValidationError:
        return None
