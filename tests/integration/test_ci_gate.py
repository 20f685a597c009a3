"""The gate of ci/ judges a campaign that was really run; its two wrappings are whole."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.pages import ROOT, code_blocks

from robovast.base.yaml_files import parse_yaml

GATE = ROOT / "ci/gate.sh"
ACTION, TEMPLATE = ROOT / "ci/github/action.yml", ROOT / "ci/gitlab/robovast-gate.yml"


def gate(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    return subprocess.run(
        [GATE, *arguments],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        timeout=600,
    )


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The example of a growing population."""
    shutil.copytree(ROOT / "configs/examples/growth_sim", tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_the_first_gate_passes_and_the_next_one_compares_with_it(project: Path) -> None:
    run = ("--", "--runtime", "process", "--config", "fixed")
    first = gate(project, "growth_sim.vast", "base", "gate", *run)
    assert first.returncode == 0, first.stderr
    assert "no earlier campaign" in (project / "gate/gate.md").read_text()
    assert 'tests="2" failures="0" errors="0"' in (project / "gate/runs.xml").read_text()
    again = gate(project, "growth_sim.vast", "base", "gate", *run)
    assert (again.returncode, "holds a campaign already" in again.stderr) == (2, True)
    shutil.move(project / "gate/campaign", project / "base")
    asked = gate(project, "growth_sim.vast", "base", "next", "--fail-on", "unclear", *run)
    assert asked.returncode == 6, asked.stderr
    comment = (project / "next/gate.md").read_text()
    assert comment.startswith("### unclear: no difference, but too few runs to exclude a rise")
    assert (project / "next/gate.xml").is_file()


def test_a_campaign_that_cannot_be_run_ends_the_gate_with_its_exit_code(tmp_path: Path) -> None:
    (tmp_path / "bad.vast").write_text("version: 1\n")
    assert gate(tmp_path, "bad.vast", "base", "gate").returncode == 2
    assert gate(tmp_path, "bad.vast").returncode == 2


def scripts(path: Path) -> list[str]:
    """The scripts of the action and of the template."""
    data = parse_yaml(path.read_bytes())
    if path == ACTION:
        return [step["run"] for step in data["runs"]["steps"] if "run" in step]
    return ["\n".join(data[".robovast-gate"]["script"])]


@pytest.mark.parametrize("path", [ACTION, TEMPLATE], ids=lambda path: path.parent.name)
def test_each_script_is_valid_and_inserts_nothing_into_itself(path: Path) -> None:
    for script in scripts(path):
        assert "${{" not in script  # names of branches are others' text
        subprocess.run(["bash", "-n"], input=script, text=True, check=True)


def test_each_input_of_the_action_is_used_and_each_used_one_exists() -> None:
    text = ACTION.read_text(encoding="utf-8")
    inputs = set(parse_yaml(text.encode())["inputs"])
    assert set(re.findall(r"inputs\.([a-z-]+)", text)) == inputs


def test_the_pages_workflow_and_pipeline_name_what_is_there() -> None:
    blocks = [
        parse_yaml(block.encode())
        for block in code_blocks("docs/how-to/compare-campaigns.md", "yaml")
    ]
    workflow, pipeline = (
        next(block for block in blocks if key in block) for key in ("jobs", "include")
    )
    (step,) = [s for s in workflow["jobs"]["gate"]["steps"] if "ci/github" in s.get("uses", "")]
    assert set(step["with"]) <= set(parse_yaml(ACTION.read_bytes())["inputs"])
    assert pipeline["gate"]["extends"] == ".robovast-gate"
    known = parse_yaml(TEMPLATE.read_bytes())[".robovast-gate"]["variables"]
    assert set(pipeline["gate"]["variables"]) <= set(known)
