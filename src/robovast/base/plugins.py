"""Plugins: by entry-point name, or by file as `<path>.py:<name>` relative to the .vast file."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from functools import lru_cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robovast.base.errors import CannotRunError, InputError, RobovastError, one_of
from robovast.base.optional_deps import missing_extra

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_FILE_REFERENCE = re.compile(r"^(?P<path>.+\.py):(?P<name>[A-Za-z_]\w*)$")


_refusal: ContextVar[str] = ContextVar("refusal", default="")
"""Why plugins in files are not loaded; empty if they are."""
_MOST = 2000
"""Most characters of what is told of an exception."""
_OURS = f"{Path(__file__).parents[1]}{os.sep}"
_PYTHON = f"{os.path.dirname(os.__file__)}{os.sep}"


def raised(error: BaseException) -> str:
    """Describe an exception of a plugin with its origin, such as `KeyError: 'a' (lab/widths.py:4)`.

    The origin is the last frame in the plugin's folder outside of RoboVAST and Python.
    """
    files = [(f.filename, f.lineno) for f in traceback.extract_tb(error.__traceback__)]
    others = [(file, line) for file, line in files if not _is_known(file)]
    folder = os.path.dirname(others[0][0]) if others else ""
    own = [f"{file}:{line}" for file, line in others if file.startswith(folder + os.sep)]
    place = f" ({own[-1]})" if own else ""
    said = f"{type(error).__name__}: {_text(error)}".removesuffix(": ")
    return shorten(said, _MOST) + shorten(place, _MOST)


def shorten(text: str, most: int) -> str:
    """A text of a plugin that can be printed and stored: lone surrogates escaped, the middle left
    out where it is longer than `most` characters."""
    whole = text.encode("utf-8", "backslashreplace").decode()
    half = most // 2
    return whole if len(whole) <= most else f"{whole[:half]} … {whole[-half:]}"


def _text(error: BaseException) -> str:
    """What an exception says; those of plugins may fail to say anything."""
    try:
        return str(error)
    except Exception as failed:
        return f"(its text cannot be had: {type(failed).__name__})"


@contextlib.contextmanager
def plugin_errors(failure: Callable[[BaseException], RobovastError]) -> Iterator[None]:
    """Wrap calls of a plugin: what it raises, even `sys.exit`, becomes the error made of it.

    Only the user's interrupt stays what it is.
    """
    try:
        yield
    except (KeyboardInterrupt, GeneratorExit):
        raise
    except BaseException as error:
        raise failure(error) from error


def _is_known(file: str) -> bool:
    installed = "site-packages" in file or "dist-packages" in file
    return file[0] == "<" or file.startswith(_OURS) or (file.startswith(_PYTHON) and not installed)


class PluginRefusedError(CannotRunError):
    """A plugin in a file is not to be loaded."""


@contextlib.contextmanager
def plugin_files_refused(why: str) -> Iterator[None]:
    """Load no plugins from files within the context."""
    token = _refusal.set(why)
    try:
        yield
    finally:
        _refusal.reset(token)


def split_file_reference(reference: str) -> tuple[str, str] | None:
    """Path and name of a `<path>.py:<name>` reference; None for entry-point names."""
    match = _FILE_REFERENCE.match(reference)
    return (match["path"], match["name"]) if match else None


@lru_cache
def plugins_of(group: str) -> dict[str, EntryPoint]:
    """Entry points of a group by name; the first of equal names wins."""
    from importlib.metadata import entry_points

    found: dict[str, EntryPoint] = {}
    for entry_point in entry_points(group=group):
        found.setdefault(entry_point.name, entry_point)
    return found


def load_plugin(reference: str, group: str, folder: str | Path) -> Any:
    """Load the object of a reference.

    Args:
        reference: an entry-point name, or `<path>.py:<name>`.
        group: entry-point group, such as `robovast.variation_types`.
        folder: base of relative paths.

    Raises:
        InputError: the plugin is missing or cannot be loaded; the message gives the cause.
        CannotRunError: a package that it imports is not installed.
    """
    parts = split_file_reference(reference)
    if parts is None:
        return _load_entry_point(reference, group)
    path, name = parts
    if why := _refusal.get():
        raise PluginRefusedError(f"{path} is not loaded: {why}")
    module = _load_file(Path(os.path.realpath(Path(folder) / path)))
    try:
        return getattr(module, name)
    except AttributeError:
        public = [key for key in vars(module) if not key.startswith("_")]
        raise InputError(
            f"{path} has no `{name}`", hint=one_of(public, f"define `{name}` in the file")
        ) from None


def _load_entry_point(name: str, group: str) -> Any:
    known = plugins_of(group)
    if name not in known:
        from difflib import get_close_matches

        near = get_close_matches(name, known, n=1)
        use = f"did you mean `{near[0]}`?" if near else f"use one of {', '.join(sorted(known))}."
        raise InputError(
            f"there is no plugin `{name}` in {group}",
            hint=f"{use} A plugin in a file is written `<path>.py:<name>`",
        )
    with plugin_errors(lambda error: _failure(_what(known[name]), error)):
        return known[name].load()


def _what(plugin: EntryPoint) -> str:
    """What cannot be loaded; to find the name of its package takes longer than to load it."""
    package = plugin.dist.name if plugin.dist else "its package"
    return f"the plugin `{plugin.name}` of {package} ({plugin.value}) cannot be loaded"


class _WithoutBytecode(SourceFileLoader):
    """Writes no bytecode beside a file: its folder may be a campaign's, which is a record."""

    def set_data(self, path: object, data: object, *, _mode: int = 0) -> None:
        """Write no bytecode."""


@lru_cache
def _load_file(path: Path) -> Any:
    if not os.path.isfile(path):
        raise InputError(
            f"there is no plugin file {path}",
            hint="correct the path, which is relative to the .vast file",
        )
    digest = hashlib.sha256(str(path).encode()).hexdigest()[:8]
    name = f"robovast_plugin_{path.stem}_{digest}"
    loader = _WithoutBytecode(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    if spec is None or spec.loader is None:
        raise InputError(f"{path} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look up a class's module
    try:
        with plugin_errors(lambda error: _failure(f"{path} cannot be imported", error)):
            spec.loader.exec_module(module)
    except RobovastError:
        del sys.modules[name]
        raise
    return module


def _failure(what: str, error: BaseException) -> RobovastError:
    """The error about a plugin whose code raises one while it is loaded."""
    if lacking := missing_extra(error, f"{what}: it"):
        return lacking
    if isinstance(error, ModuleNotFoundError):
        return CannotRunError(
            f"{what}: the package `{error.name}` is not installed here.", hint="install it"
        )
    if isinstance(error, RobovastError):
        return type(error)(f"{what}: {error.message}", hint=error.hint)
    return InputError(f"{what}: {type(error).__name__}: {error}")
