"""Collects missing data and errors of plugins while a campaign is described."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, TypeVar

from robovast.base.errors import InputError
from robovast.base.plugins import raised, split_file_reference

_MOST_NAMED = 3
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
"""Memory address in an object's text; it would make equal errors look different."""

_LIST = "no configurations.yaml"
_RECORDS = (_LIST, "no execution.yaml", "no config.yaml", "no sysinfo.yaml")
"""What every campaign of another tool lacks; the first one shows that it is from another tool."""

ResultT = TypeVar("ResultT")


class Findings:
    """Missing data (reported, never fatal) and errors of plugins.

    Args:
        own_plugins: whether plugins in the campaign's own files are executed.
    """

    def __init__(self, *, own_plugins: bool = True) -> None:
        self._own_plugins = own_plugins
        self._missing: dict[str, list[str]] = {}
        self._faults: dict[str, list[str]] = {}

    def missing(self, what: str, where: str) -> None:
        """Add missing data, such as `no test.xml` in `hall-1/0`."""
        self._missing.setdefault(what, []).append(where)

    def leaves_out(self, plugin: str) -> bool:
        """Whether a plugin must not be executed; then it is added as missing."""
        if self._own_plugins or split_file_reference(plugin) is None:
            return False
        self.missing("plugins of the campaign that were not run, nothing added", plugin)
        return True

    def fault(self, what: str, where: str = "") -> None:
        """Add an error of a plugin."""
        self._faults.setdefault(_ADDRESS.sub("", what), []).append(where)

    def call(
        self, who: str, where: str, function: Callable[..., ResultT], *args: Any
    ) -> ResultT | None:
        """Call a plugin's function; if it raises or exits, add an error and return None."""
        try:
            return function(*args)
        except InputError as error:
            self.fault(f"{who}: {error}", where)
        except (Exception, SystemExit) as error:
            self.fault(f"{who}: {raised(error)}", where)
        return None

    @property
    def notices(self) -> list[str]:
        """One line for each kind of missing data; one for all that another tool never writes."""
        missing = dict(self._missing)
        lines = []
        if _LIST in missing:
            absent = [what for what in _RECORDS if missing.pop(what, None)]
            names = ", ".join(what.removeprefix("no ") for what in absent)
            lines = [
                f"no {names}: another tool ran this campaign; its metadata lacks the contents of "
                "these files"
            ]
        return lines + [f"{what}: {_places(where)}" for what, where in missing.items()]

    @property
    def faults(self) -> list[str]:
        """One line for each kind of error."""
        return [
            f"{what} (in {_places(where)})" if any(where) else what
            for what, where in self._faults.items()
        ]


def _places(where: list[str]) -> str:
    unique = list(dict.fromkeys(where))
    more = len(unique) - _MOST_NAMED
    return ", ".join(unique[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
