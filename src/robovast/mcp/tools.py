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
    """Wrap a function so that its errors for users reach the assistant unchanged."""

    @functools.wraps(function)
    def tool(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except RobovastError as error:
            raise ToolError(str(error), log_level=logging.DEBUG) from None

    return tool
