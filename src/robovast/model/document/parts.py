"""The parts of a document that its checks are about."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from robovast.base.errors import InputError
from robovast.model.document.execution import Execution
from robovast.model.document.model import ConfigurationEntry
from robovast.model.document.search.section import Search
from robovast.model.document.source import KeyPath, Source
from robovast.model.scenario import Scenario, read_scenario


@dataclass(frozen=True)
class Parts:
    """Those parts of a document that are valid on their own."""

    folder: Path
    source: Source
    entries: dict[int, ConfigurationEntry]
    execution: Execution | None
    search: Search | None

    @cached_property
    def scenario_key(self) -> KeyPath:
        """Path of the key that names the scenario; `execution` when no key does."""
        if self.execution is not None and self.execution.scenario_file is not None:
            return ("execution", "scenario_file")
        for index, entry in self.entries.items():
            if entry.scenario_file is not None:
                return ("configuration", index, "scenario_file")
        return ("execution",)

    @cached_property
    def scenario(self) -> Scenario | InputError | None:
        """The scenario; an error when it cannot be read; None when none is named."""
        names = [self.execution.scenario_file if self.execution else None]
        names += [entry.scenario_file for entry in self.entries.values()]
        name = next((name for name in names if name is not None), None)
        if name is None:
            return None
        try:
            return read_scenario(self.folder / name)
        except InputError as error:
            return error
