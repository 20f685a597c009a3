"""Each command that reads a .vast file parses its scenario if scenario-execution is installed."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import ExitCode

from .conftest import Vast

VAST = "version: 1\nexecution: {scenario_file: a.osc, runs: 1}\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A document, and an environment whose parser is told what to say."""
    (tmp_path / "a.vast").write_text(VAST)
    (tmp_path / "a.osc").write_text("scenario a:\n    x: int =\n")
    environment = tmp_path / "environment"
    (environment / "bin").mkdir(parents=True)
    (environment / "bin" / "scenario_execution").touch()
    monkeypatch.setenv("ROBOVAST_PROCESS_ENV", str(environment))
    monkeypatch.chdir(tmp_path)
    return environment


def _parser_says(environment: Path, text: str) -> None:
    python = environment / "bin" / "python"
    python.write_text(f"#!/bin/sh\n{text}\n")
    python.chmod(0o755)


@pytest.mark.parametrize(
    "command",
    [
        *("config list", "config check", "config info", "config generate out"),
        *("exec local run out", "exec local run --start-only out", "exec local prepare-run out"),
        *("exec cluster run", "exec cluster run --dry-run", "exec cluster prepare-run out"),
    ],
)
def test_a_mistake_is_reported(folder: Path, vast: Vast, command: str) -> None:
    _parser_says(folder, """echo '{"line": 2, "column": 13, "found": "\\\\n"}'""")
    result = vast("-V", "a.vast", *command.split())
    assert result.code == ExitCode.BAD_INPUT
    assert "a.osc:2:13: the scenario cannot be parsed: the line ends too early" in result.err
    assert "The line is: `x: int =`" in result.err
    assert not Path("out").exists()


@pytest.mark.parametrize("answer", ["echo null", "exit 1", "echo Segmentation fault"])
def test_a_parser_that_finds_or_says_nothing_is_no_hindrance(
    folder: Path, vast: Vast, answer: str
) -> None:
    _parser_says(folder, answer)
    result = vast("-V", "a.vast", "config", "list")
    assert (result.code, "config1" in result.out) == (0, True)
