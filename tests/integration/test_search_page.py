"""What docs/how-to/search.md teaches works as it stands there."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from support.campaigns.local import Recorder
from support.pages import code_blocks, write_files

from robovast.execution.local import LocalOptions
from robovast.model.document import load_document
from robovast.search.local import SearchSummary, execute_document

PAGE = "docs/how-to/search.md"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "files").mkdir()
    languages = ("osc", "sh", "yaml", "python")
    written = {name for one in languages for name in write_files(PAGE, one, tmp_path)}
    needed = {"scenario.osc", "files/robot.sh", "search.vast", "extract.py", "my_strategy.py"}
    assert needed <= written
    return tmp_path


def test_every_command_of_the_page(folder: Path) -> None:
    blocks = [block for block in code_blocks(PAGE, "bash") if "configs/examples" not in block]
    lines = [line for block in blocks for line in block.splitlines()]
    for line in lines:
        words = shlex.split(line, comments=True)
        assert words[0] == "vast"
        words = [str(_made(folder / word)) if "-2026-" in word else word for word in words]
        command = [sys.executable, "-m", "robovast_cli", *words[1:]]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, (line, done.stdout + done.stderr)
    assert len(lines) >= 8
    assert b"<svg" in (folder / "map.svg").read_bytes()
    assert (folder / "progress.png").read_bytes().startswith(b"\x89PNG")


def _made(named: Path) -> Path:
    """The campaign that a page names with another time."""
    return next(named.parent.glob(f"{named.name.partition('-')[0]}-*"))


def test_the_plugins_of_the_page(folder: Path) -> None:
    path = folder / "search.vast"
    text = path.read_text().replace("strategy: random", "strategy: my_strategy.py:Corners")
    extract = "  extract: {plugin: extract.py:Slowest, params: {scale: 1.0}}\n"
    text = text.replace("failure_rate", "time").replace("batches: 2", "batches: 5")
    path.write_text(text + extract)
    options = LocalOptions(runtime="process", runs=1)
    summary = execute_document(load_document(path), folder / "results", options, Recorder())
    assert isinstance(summary, SearchSummary)
    assert summary.report is not None
    assert [e.objectives["time"] for e in summary.report.evaluations] == [10.0, 0.0]
    assert summary.stop is not None
    assert summary.stop.kind == "exhausted"
