"""Loads and calls publication plugins, and validates what they return."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robovast.analysis.publication.context import PublicationContext
from robovast.base.errors import InputError, RobovastError, StorageError, one_of
from robovast.base.plugins import load_plugin, raised
from robovast.model.document.section import PluginCall

GROUP = "robovast.publication_plugins"
PACKAGING = "packaging"
UPLOAD = "upload"

_OWN = frozenset({"results_dir", "config_dir", "context"})


@dataclass(frozen=True)
class PublicationPlugin:
    """A plugin as called in a .vast file."""

    name: str
    function: Callable[..., Any]
    kind: str
    """`packaging` or `upload`."""
    parameters: Mapping[str, Any]

    @classmethod
    def load(cls, call: PluginCall, folder: Path) -> PublicationPlugin:
        """Load the plugin of a call.

        Raises:
            InputError: the plugin is missing or invalid, or lacks a given parameter.
        """
        function = load_plugin(call.name, GROUP, folder)
        if inspect.isclass(function):
            function = _instantiate(call.name, function)
        if not callable(function):
            raise InputError(
                f"the publication plugin `{call.name}` is a {type(function).__name__}",
                hint="write a function, or a class whose objects can be called",
            )
        kind = getattr(function, "plugin_type", PACKAGING)
        if kind not in {PACKAGING, UPLOAD}:
            raise InputError(
                f"the publication plugin `{call.name}` has the plugin_type {kind!r}",
                hint=f"use `{PACKAGING}` or `{UPLOAD}`",
            )
        plugin = cls(call.name, function, kind, call.parameters)
        plugin._check_parameters()
        return plugin

    @property
    def takes_context(self) -> bool:
        """True if the plugin can publish some of a results folder's campaigns, not only all."""
        return "context" in self._named

    def check(self, results_dir: Path, config_dir: Path, context: PublicationContext) -> None:
        """Let the plugin check, if it can, whether it could work, before any plugin starts.

        Raises:
            RobovastError: the plugin's check failed.
        """
        look = getattr(self.function, "check", None)
        if look is not None:
            self._call(look, results_dir, config_dir, context=context, **self.parameters)

    def publish(
        self, results_dir: Path, config_dir: Path, context: PublicationContext, *, force: bool
    ) -> tuple[str, list[Path]]:
        """Call the plugin; return its message and the files that it made.

        Raises:
            RobovastError: the plugin failed; the message is its own or its exception's.
        """
        given = dict(self.parameters)
        if force and ("overwrite" in self._named or self._takes_any):
            given["overwrite"] = True
        if self.takes_context:
            given["context"] = context
        return self._checked(
            self._call(self.function, results_dir, config_dir, **given), results_dir
        )

    def _call(
        self, function: Callable[..., Any], results_dir: Path, config_dir: Path, **given: Any
    ) -> Any:
        try:
            return function(str(results_dir), str(config_dir), **given)
        except RobovastError:
            raise
        except (Exception, SystemExit) as error:
            raise StorageError(
                f"the publication plugin `{self.name}` failed: {raised(error)}"
            ) from error

    def _checked(self, returned: Any, results_dir: Path) -> tuple[str, list[Path]]:
        match returned:
            case (bool() as good, str() as message):
                files: list[Any] = []
            case (bool() as good, str() as message, list() | tuple() as made):
                files = list(made)
            case _:
                raise StorageError(
                    f"the publication plugin `{self.name}` returned {returned!r}",
                    hint="return (success, message), or (success, message, files)",
                )
        if not good:
            raise StorageError(f"the publication plugin `{self.name}` failed: {message}")
        if not all(isinstance(file, str | Path) for file in files):
            raise StorageError(
                f"the publication plugin `{self.name}` returned files that are not paths: "
                f"{files!r}",
                hint="return paths",
            )
        return message, [results_dir / file for file in files]

    def _check_parameters(self) -> None:
        reserved = _OWN.intersection(self.parameters)
        if reserved:
            raise InputError(
                f"the publication plugin `{self.name}` cannot be given `{min(reserved)}`: "
                "RoboVAST supplies that.",
                hint="remove the parameter",
            )
        unknown = [] if self._takes_any else sorted(set(self.parameters) - set(self._named))
        if unknown:
            known = [name for name in self._named if name not in _OWN]
            raise InputError(
                f"the publication plugin `{self.name}` has no parameter `{unknown[0]}`",
                hint=one_of(known, "remove the parameter"),
            )
        missing = sorted(
            name
            for name, parameter in self._named.items()
            if parameter.default is parameter.empty and name not in {*self.parameters, *_OWN}
        )
        if missing:
            raise InputError(
                f"the publication plugin `{self.name}` needs the parameter `{missing[0]}`.",
                hint="add the parameter in the .vast file",
            )

    @property
    def _named(self) -> dict[str, inspect.Parameter]:
        kinds = {inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY}
        return {name: item for name, item in self._signature.items() if item.kind in kinds}

    @property
    def _takes_any(self) -> bool:
        return any(item.kind is item.VAR_KEYWORD for item in self._signature.values())

    @property
    def _signature(self) -> Mapping[str, inspect.Parameter]:
        return inspect.signature(self.function).parameters


def _instantiate(name: str, plugin_class: type) -> Any:
    try:
        return plugin_class()
    except (Exception, SystemExit) as error:
        raise InputError(
            f"the publication plugin `{name}` cannot be instantiated: {raised(error)}"
        ) from error
