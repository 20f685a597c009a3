"""The workspace of a command: the project, its .vast file and its results."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from robovast.base.errors import InputError
from robovast.base.paths import normalized
from robovast_cli.ui.progress_line import progress_line
from robovast_cli.ui.report import echo_stderr

if TYPE_CHECKING:
    from robovast.model.document import Document
    from robovast.model.project import Project

DEFAULT_RESULTS = Path("results")


@dataclass
class Workspace:
    """The global options of `vast`, and the project."""

    vast_file: Path | None = None
    """As given with `--vast-file`."""
    log_level: str | None = None
    """As given with `--log-level`."""

    @cached_property
    def project(self) -> Project | None:
        """The project that the working directory is in."""
        from robovast.model.project import find_project

        project = find_project(Path.cwd())
        if project is not None and project.log_level and not self.log_level:
            set_log_level(project.log_level)
        return project

    @property
    def path(self) -> Path:
        """The .vast file.

        Raises:
            InputError: none is named, and the working directory does not contain exactly one.
        """
        if self.vast_file is not None:
            return self.vast_file
        if self.project is not None:
            return shown(self.project.vast_file)
        found = sorted(Path().glob("*.vast"))
        if len(found) == 1:
            return found[0]
        what = ("several .vast files" if found else "no .vast file") + " found in this folder"
        names = f" ({', '.join(map(str, found))})" if found else ""
        raise InputError(
            f"{what}{names}",
            hint="pass one with `vast -V FILE …`, or create a project with `vast init FILE`",
        )

    def document(self, *, parse_scenario: bool = True) -> Document:
        """Return the checked .vast file; keys without effect are reported on stderr.

        Args:
            parse_scenario: False if the caller parses the scenario itself.

        Raises:
            InputError: the file is missing, or the file or its scenario is invalid.
        """
        _ = self.project  # sets its log level
        path = self.path
        with progress_line(f"Reading {path.name}"):
            from robovast.execution.local.scenario_syntax import check_syntax
            from robovast.model.document import load_document

            document = load_document(path)
            if parse_scenario:
                check_syntax(document.scenario)
        for warning in document.warnings:
            echo_stderr(f"warning: {warning}")
        return document

    @property
    def results(self) -> Path:
        """Folder of campaigns: the project's results folder, or `results` in this folder."""
        return (
            shown(normalized(self.project.results_dir))
            if self.project is not None
            else DEFAULT_RESULTS
        )


def shown(path: Path) -> Path:
    """Return a path relative to the working directory, if it is below, else absolute."""
    absolute = path.absolute()
    return absolute.relative_to(Path.cwd()) if absolute.is_relative_to(Path.cwd()) else absolute


def set_log_level(name: str) -> None:
    """Set the verbosity on stderr."""
    logging.getLogger().setLevel(name.upper())
