"""Shared parts of all tools."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from typing import Any, Protocol

from fastmcp import FastMCP
from fastmcp.exceptions import ToolError

from robovast.base.errors import RobovastError


class McpPlugin(Protocol):
    """A group of tools; entry points of `robovast.mcp_plugins` refer to such classes."""

    @property
    def name(self) -> str:
        """Name in messages."""

    def register(self, mcp: FastMCP) -> None:
        """Add tools, prompts and resources to a server."""


_READS = {
    "readOnlyHint": True,
    "destructiveHint": False,
    "idempotentHint": True,
    "openWorldHint": False,
}


def add_tools(mcp: FastMCP, *functions: Callable[..., Any]) -> None:
    """Add read-only functions as tools under their own names."""
    for function in functions:
        mcp.tool(_refusing(function), annotations=_READS)


def _refusing(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a function so that its errors for users reach the assistant unchanged.

    Runs may give files names that are no text, and requests may name what no file is called.
    """

    @functools.wraps(function)
    def tool(*args: Any, **kwargs: Any) -> Any:
        for name, value in kwargs.items():
            if isinstance(value, str) and ("\0" in value or _as_text(value) != value):
                raise ToolError(f"`{name}` is not valid text.", log_level=logging.DEBUG)
        try:
            return _as_text(function(*args, **kwargs))
        except RobovastError as error:
            raise ToolError(str(error), log_level=logging.DEBUG) from None

    return tool


def _as_text(value: Any) -> Any:
    """Data with `?` in place of what UTF-8 has no code for."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode()
    if isinstance(value, dict):
        return {_as_text(key): _as_text(item) for key, item in value.items()}
    return [_as_text(item) for item in value] if isinstance(value, list) else value
