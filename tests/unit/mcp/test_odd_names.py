"""Names that are no text fail neither an answer nor the server."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import anyio
import pytest
from fastmcp import Client
from fastmcp.exceptions import ToolError
from support.campaigns.stored import NAME, write_campaign

from robovast.mcp.server import make_server


def call(results: Path, tool: str, **arguments: Any) -> Any:
    async def answer() -> Any:
        async with Client(make_server(results)) as client:
            return (await client.call_tool(tool, arguments)).data

    return anyio.run(answer)


@pytest.fixture
def results(tmp_path: Path) -> Path:
    root = write_campaign(tmp_path, variants=[{"speed": 1}], runs=1)
    (run,) = (path.parent for path in root.glob("*/0/run.json"))
    (Path(os.fsdecode(os.fsencode(run) + b"/\xff.csv"))).touch()
    return tmp_path


def test_a_run_with_a_file_whose_name_is_no_text_is_told(results: Path) -> None:
    (run,) = results.glob("*/*/0")
    found = call(results, "get_run", campaign=NAME, configuration=run.parent.name, run=0)
    assert "?.csv" in str(found)


@pytest.mark.parametrize("name", ["a\0b", "a\ud800"])
def test_a_question_with_such_a_name_is_refused(results: Path, name: str) -> None:
    with pytest.raises(ToolError, match="`configuration` is not valid text"):
        call(results, "get_configuration_history", campaign=NAME, configuration=name)
