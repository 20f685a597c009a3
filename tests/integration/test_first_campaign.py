"""The first command that people type ends with the next one, and README goes on from there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.pages import ROOT, code_blocks, write_files

VAST = Path(sys.executable).with_name("vast")


@pytest.fixture
def said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What `scripts/example` says in a clone, where everything is installed."""
    monkeypatch.chdir(tmp_path)
    Path("scripts").mkdir()
    Path("scripts/example").write_text((ROOT / "scripts" / "example").read_text())
    Path("scripts/setup").write_text("#!/bin/sh\n")
    for script in Path("scripts").iterdir():
        script.chmod(0o755)
    Path("configs").symlink_to(ROOT / "configs")
    Path(".venv").mkdir()
    Path(".venv/bin").symlink_to(VAST.parent)
    done = subprocess.run(["scripts/example"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.splitlines()


def test_an_example_ends_with_what_to_type_next_and_readme_queries_it(said: list[str]) -> None:
    steps = said[said.index("What next?") + 1 :]
    activate, summary, _, page, _ = (line.strip() for line in steps)
    done = subprocess.run(
        ["bash", "-euc", f"{activate}\n{summary}"], capture_output=True, text=True
    )
    assert "26 of 26 runs stored: 26 passed" in done.stdout, done.stderr
    assert page == "scripts/setup robot && vast evaluation gui -r results"
    (block,) = (block for block in code_blocks("README.md", "bash") if "results query" in block)
    query = block[block.index("vast results query") :].partition("   #")[0]
    path = f"{VAST.parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euc", f"vast results postprocess >&2\n{query}"],
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert (
        "26 runs, tables and metadata are written (the .vast file has no commands)" in done.stderr
    )
    assert done.stdout in code_blocks("README.md", "text")


def test_the_campaign_on_the_page_of_the_installation_runs(tmp_path: Path) -> None:
    page = "docs/how-to/install.md"
    assert write_files(page, "osc", tmp_path) == ["scenario.osc"]
    assert write_files(page, "yaml", tmp_path) == ["guess.vast"]
    run, summary = code_blocks(page, "bash")[-2:]
    done = subprocess.run(
        ["bash", "-euc", f"{run}\n{summary}"],
        cwd=tmp_path,
        env={**os.environ, "PATH": f"{VAST.parent}{os.pathsep}{os.environ['PATH']}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    (end,) = code_blocks(page, "text")
    assert end in done.stdout
    assert "3 configurations: 1 failing, 2 inconclusive" in done.stdout
