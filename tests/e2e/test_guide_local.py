"""Sections 3 and 4 of the developers' guide, typed as they stand."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCENARIO = """\
import osc.helpers

scenario my_test:
    speed: float = 1.0
    do serial:
        log("driving")
"""

DOCUMENT = """\
version: 1
metadata:
  name: my_campaign
execution:
  image: {image}
  scenario_file: my_test.osc
  runs: 2
"""


@pytest.fixture
def shell(docker_daemon, slim_image: str, tmp_path: Path):
    """A shell in a project folder, with `vast` on the PATH and an engine that answers."""
    (tmp_path / "my_test.osc").write_text(SCENARIO)
    (tmp_path / "my.vast").write_text(DOCUMENT.format(image=slim_image))
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {**os.environ, **docker_daemon.env, "PATH": path}

    def call(command: str, text: str = "") -> str:
        result = subprocess.run(
            ["bash", "-c", command],
            cwd=tmp_path,
            env=environment,
            input=text,
            capture_output=True,
            text=True,
            check=False,
        )
        assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"
        return result.stdout

    return call


def test_section_3_initial_configuration(shell, slim_image: str) -> None:
    shell("vast exec local prepare-run --config config1 ./test_run")
    assert "Results:" in shell("./test_run/run.sh")
    shell(f"./test_run/run.sh --image {slim_image}")
    assert "uid=" in shell("./test_run/run.sh --shell", "id\n")
    shell("./test_run/run.sh --network-host")
    shell("./test_run/run.sh --no-gui")
    shell("./test_run/run.sh -t -d")
    shell("vast exec local run --config config1 ./test_out")
    listing = shell("ls -l ./test_out/*-*/config1/0/")
    assert {"test.xml", "run.json", "job"} <= set(listing.split())


def test_section_4_define_configurations(shell, tmp_path: Path) -> None:
    with (tmp_path / "my.vast").open("a") as file:
        file.write(
            "configuration:\n- name: fast\n  parameters:\n  - speed: 2.0\n"
            "- name: sweep\n  variations:\n"
            "  - ParameterVariationList: {name: speed, values: [1.0, 3.0]}\n"
        )
    listing = shell("vast config list")
    assert all(name in listing for name in ("fast", "sweep-1", "sweep-2"))
    shell("vast exec local run --config sweep-2 --runs 1 ./test_out")
    runs = [path.relative_to(tmp_path) for path in tmp_path.glob("test_out/*/*/0/test.xml")]
    assert [path.parts[2] for path in runs] == ["sweep-2"]
