"""`vast mcp`, started and asked as clients do it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from anyio.from_thread import BlockingPortal, start_blocking_portal
from fastmcp import Client
from fastmcp.client.transports import StdioTransport

from support.patience import PATIENCE

VAST = str(Path(sys.executable).with_name("vast"))


@dataclass(frozen=True)
class Refusal:
    """What the server says when it does not do it."""

    message: str


class Assistant:
    """A client in a session."""

    def __init__(self, portal: BlockingPortal, client: Client[Any]) -> None:
        self._portal = portal
        self._client = client

    def result(self, tool: str, **arguments: Any) -> Any:
        """What a tool answers with, as the protocol has it."""
        ask = partial(self._client.call_tool, tool, arguments, raise_on_error=False)
        return self._portal.call(ask)

    def call(self, tool: str, **arguments: Any) -> Any:
        """Data that a tool answers with, or its refusal."""
        result = self.result(tool, **arguments)
        return Refusal(result.content[0].text) if result.is_error else result.structured_content

    def tools(self) -> set[str]:
        """Names of all tools."""
        return {tool.name for tool in self._portal.call(self._client.list_tools)}

    def prompt(self, name: str, **arguments: Any) -> str:
        """Text of a prompt."""
        return self._portal.call(self._client.get_prompt, name, arguments).messages[0].content.text


@contextmanager
def session(transport: Any, **options: Any) -> Iterator[Assistant]:
    """Talk to a server."""
    with start_blocking_portal() as portal:
        client = Client(transport, timeout=PATIENCE, **options)
        with portal.wrap_async_context_manager(client):
            yield Assistant(portal, client)


def over_stdio(results: Path, log: Path, **env: str) -> StdioTransport:
    """The server as a child of its client, under the name that the guide's users know."""
    return StdioTransport(
        VAST,
        ["eval", "mcp-server", "-r", str(results)],
        env={**os.environ, **env},
        keep_alive=False,
        log_file=log,
    )


@contextmanager
def over_http(results: Path) -> Iterator[str]:
    """The server over HTTP; what it printed. Ends it with Ctrl-C and wants it to end well."""
    command = [VAST, "mcp", "-r", str(results), "--transport", "streamable-http", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    line = process.stdout.readline()
    try:
        assert "http://" in line, process.communicate()
        yield line
        process.send_signal(signal.SIGINT)
        _, complaints = process.communicate(timeout=PATIENCE)
        assert not complaints, complaints
        assert process.returncode == 0
    finally:
        process.kill()
        process.communicate()
