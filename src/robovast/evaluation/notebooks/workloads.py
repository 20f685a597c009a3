"""Finds the notebooks of a campaign."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.campaign.layout import Layout
from robovast.evaluation.confined_files import MissingError, OutsideError, read_small, resolved
from robovast.evaluation.untrusted_data import mapping, parse_yaml
from robovast.model.naming import holds_campaign

SCOPES = ("campaign", "config", "run")
"""Scopes of notebooks; the index is the depth of the data's folder below the campaign's."""
BATCH = "batch"
"""Scope of notebooks about a batch of a search; their data's folder is the campaign's."""


@dataclass(frozen=True)
class Notebook:
    """One notebook of a workload."""

    workload: str
    scope: str
    path: str
    """Path relative to the .vast file's folder."""
    folder: Path
    """Folder of the .vast file, without links."""

    def file(self) -> Path:
        """The resolved path.

        Raises:
            InputError: the file is missing or outside of the .vast file's folder.
        """
        try:
            return resolved(self.folder, self.path)
        except MissingError:
            raise MissingError(
                f"{self.folder} holds no {self.path}, which `{self.workload}` names for a "
                f"{self.scope}",
                hint="name a .vast file that is up to date with `-o`",
            ) from None
        except OutsideError:
            raise OutsideError(
                f"{self.path} is outside of the .vast file's folder {self.folder}.",
                hint="move the notebook into that folder",
            ) from None


@dataclass(frozen=True)
class Target:
    """Data to analyze: a campaign, a batch of a search, a configuration or a run."""

    results: Path
    """The results folder, without links."""
    names: tuple[str, ...]
    """Name of the campaign, then of the configuration, then number of the run."""
    batch: int | None = None
    """Number of a batch of the campaign, which is a search."""

    @property
    def scope(self) -> str:
        """One of `SCOPES`, or `BATCH`."""
        return SCOPES[len(self.names) - 1] if self.batch is None else BATCH

    @property
    def folder(self) -> Path:
        """The value of `DATA_DIR`.

        Raises:
            InputError: the campaign, configuration or run is missing.
        """
        path = resolved(self.results, "/".join(self.names))
        campaign = self.results / self.names[0]
        if path.relative_to(self.results).parts != self.names or not os.path.isdir(path):
            raise MissingError(f"{path} is not a results folder.", hint="name the results folder")
        if not holds_campaign(campaign):
            raise MissingError(f"{campaign} is not a campaign.")
        if self.batch is not None:
            self._check_batch(Layout(campaign), self.batch)
        return path

    def _check_batch(self, layout: Layout, batch: int) -> None:
        """Check that a batch of the campaign was scored.

        Raises:
            InputError: it was not.
        """
        if len(self.names) > 1:
            raise InputError("A batch belongs to a campaign, not to a configuration or a run.")
        if batch < 0 or not os.path.isfile(layout.batch(batch, ".result")):
            scored = next(n for n in count() if not os.path.isfile(layout.batch(n, ".result")))
            there = f"its batches are 0 to {scored - 1}" if scored else "it has none yet"
            raise MissingError(f"{layout.root} has no batch {batch} with scores; {there}.")


def target_of(path: Path, batch: int | None = None) -> Target:
    """The target of a folder, or of a batch of the search there.

    Raises:
        InputError: the folder is not a campaign, configuration or run.
    """
    folder = Path(os.path.realpath(path))
    for results in reversed(folder.parents[: len(SCOPES)]):  # the outermost campaign
        names = folder.relative_to(results).parts
        if holds_campaign(results / names[0]):
            return Target(results, names, batch)
    raise InputError(
        f"{path} is the folder of no campaign, configuration or run.",
        hint="name the folder of a campaign, configuration or run",
    )


def find_notebooks(target: Target, override: Path | None) -> list[Notebook]:
    """The notebooks for a target, in document order.

    Args:
        target: the data to analyze.
        override: a .vast file that replaces the campaign's own.

    Raises:
        InputError: there are several .vast files, or one that cannot be read.
    """
    folder, data = read_document(target, override)
    return [
        Notebook(workload, target.scope, path, folder)
        for workload, scopes in _workloads(data)
        if isinstance(path := scopes.get(target.scope), str)
    ]


def read_document(target: Target, override: Path | None) -> tuple[Path, Mapping[str, Any]]:
    """Folder and content of a campaign's .vast file; no content if the campaign has none.

    Args:
        target: the campaign, or data in it.
        override: a .vast file that replaces the campaign's own.

    Raises:
        InputError: there are several .vast files, or one that cannot be read.
    """
    document = override.resolve() if override else _own_document(target)
    if document is None:
        return target.results, {}
    folder = document.parent
    data = parse_yaml(read_small(folder, document.name))
    if not isinstance(data, dict):
        raise InputError(f"{document} is not a YAML file with keys.")
    return folder, data


def find_notebook(target: Target, workload: str | None, override: Path | None) -> Notebook:
    """The notebook of a workload, which may be omitted if there is only one.

    Raises:
        InputError: there is none, or there are several.
    """
    found = find_notebooks(target, override)
    matching = [one for one in found if workload in (None, one.workload)]
    if len(matching) == 1:
        return matching[0]
    known = ", ".join(f"`{one.workload}`" for one in found)
    if not found:
        raise MissingError(
            f"`evaluation.visualization` of {target.names[0]} names no notebook for a "
            f"{target.scope}.",
            hint="add a notebook to `evaluation.visualization`",
        )
    raise MissingError(
        f"{workload or 'none'} is not a workload of the .vast file", hint=f"use one of {known}"
    )


def _own_document(target: Target) -> Path | None:
    """The campaign's .vast file; None when it has none, as one that was aborted early."""
    layout = Layout(target.results / target.names[0])
    found = layout.documents
    if not found:
        return None
    if len(found) > 1:
        raise InputError(
            f"{layout.config} holds {len(found)} .vast files", hint="name the one to use with `-o`"
        )
    return resolved(target.results, str(found[0].relative_to(target.results)))


def _workloads(document: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Notebooks of each workload by scope, under either spelling; the last one wins."""
    found: dict[str, Mapping[str, Any]] = {}
    for section in ("evaluation", "analysis"):
        workloads = mapping(document.get(section)).get("visualization")
        for workload in workloads if isinstance(workloads, list) else []:
            found |= {name: mapping(scopes) for name, scopes in mapping(workload).items()}
    yield from found.items()
