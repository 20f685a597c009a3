"""Campaigns of the kinds that users bring, written for containers, as plain processes."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from textwrap import dedent

import pytest
from support.campaigns.local import run, verdicts

from robovast.execution.local import ExecutionSummary

EXECUTION = """\
execution:
  image: no.registry/robovast:latest
  scenario_file: scenario.osc
  runs: {runs}
  runs_per_job: {pack}
  run_files: ['**/files/*.py']
"""

GROWTH = """\
version: 1
metadata: {name: growth_model}
configuration:
- name: test
  variations:
  - ParameterVariationList: {name: initial_population, values: [5, 20, 80, 320]}
  - ParameterVariationList: {name: growth_rate, values: [0.02, 0.3, 0.9]}
- name: test-fixed-values
  parameters:
  - growth_rate: 0.07
  - initial_population: 123
"""
GROWTH_SCENARIO = """\
import osc.helpers

scenario growing:
    initial_population: int = 10
    growth_rate: float = 0.1
    capacity: int = 500
    here: common
    do serial:
        run_process("python3 /config/files/growth.py --start %s" % initial_population
            + " --rate %s" % growth_rate + " --capacity %s" % capacity
            + " --output " + here.get_output_directory())
"""
GROWTH_PROGRAM = """\
import argparse, pathlib

parser = argparse.ArgumentParser()
parser.add_argument("--start", type=int)
parser.add_argument("--rate", type=float)
parser.add_argument("--capacity", type=int)
parser.add_argument("--output", type=pathlib.Path)
given = parser.parse_args()
assert str(given.output).startswith("/out/"), given.output
assert pathlib.Path("/config/scenario.osc").is_file()
size = float(given.start)
with open(given.output / "out.csv", "w") as file:
    file.write(f"# growth_rate={given.rate}\\nstep,population\\n")
    for step in range(50):
        file.write(f"{step},{size}\\n")
        size += given.rate * size * (1 - size / given.capacity)
"""

GRID = """\
version: 1
metadata: {name: landing_grid}
configuration:
- name: grid
  variations:
  - ParameterVariationList: {name: height, values: [1.0, 4.0]}
  - ParameterVariationList: {name: gain, values: [0.5, 4.0]}
  - ParameterVariationList: {name: damping, values: [0.5, 3.0]}
  - ParameterVariationList: {name: wind, values: [0.0, 0.4]}
"""
GRID_SCENARIO = """\
import osc.helpers

scenario landing:
    height: float = 1.0
    gain: float = 1.0
    damping: float = 1.0
    wind: float = 0.0
    here: common
    do serial:
        run_process("python3 " + here.get_scenario_file_directory() + "/files/descend.py"
            + " %s" % height + " %s" % gain + " %s" % damping + " %s" % wind
            + " " + here.get_output_directory())
"""
GRID_PROGRAM = """\
import json, os, sys
import numpy

height, gain, damping, wind = map(float, sys.argv[1:5])
noise = numpy.random.default_rng(int(10 * height)).normal(0.0, wind, 400)
track, speed = numpy.empty(400), 0.0
for step in range(400):
    track[step] = height
    speed += 0.02 * (-gain * height - damping * speed + noise[step])
    height += 0.02 * speed
os.chdir(sys.argv[5])
numpy.savetxt("track.csv", track, header="height")
json.dump({"overshoot": float(-track.min())}, open("landing.json", "w"))
sys.exit(int(track.min() < -0.6))
"""


def execute(
    tmp_path: Path, document: str, scenario: str, program: str, runs: int
) -> ExecutionSummary:
    folder = tmp_path / "in"
    (folder / "files").mkdir(parents=True)
    name = scenario.partition("/files/")[2].partition(".py")[0]
    (folder / "files" / f"{name}.py").write_text(program)
    (folder / "scenario.osc").write_text(scenario)
    (folder / "campaign.vast").write_text(document)
    return run(folder / "campaign.vast", tmp_path / "out", runs=runs)


@pytest.mark.parametrize("pack", [1, 5])
def test_a_program_of_ones_own_over_two_parameters(tmp_path: Path, pack: int) -> None:
    document = GROWTH + EXECUTION.format(runs=20, pack=pack)
    summary = execute(tmp_path, document, GROWTH_SCENARIO, GROWTH_PROGRAM, runs=1)
    names = {f"test-{one}-{two}" for one in range(1, 5) for two in range(1, 4)}
    names.add("test-fixed-values")
    assert verdicts(summary) == {f"{name}/0": "passed" for name in names}
    campaign = summary.campaign
    assert campaign.name.startswith("growth-model-20")
    top = {path.name for path in campaign.iterdir()}
    assert top == names | {"_config", "_execution", "_jobs", "_transient"}
    for folder in (campaign / name / "0" for name in names):
        assert {"test.xml", "out.csv", "job"} <= {path.name for path in folder.iterdir()}
        job = folder / "job"
        assert job.readlink().parts[:3] == ("..", "..", "_jobs")
        assert {"sysinfo.yaml", "resource_usage_main.csv"} <= {path.name for path in job.iterdir()}
    lines = (campaign / "test-2-3" / "0" / "out.csv").read_text().splitlines()
    assert lines[0] == "# growth_rate=0.9"
    first, *_, last = csv.DictReader(lines[1:])
    assert (first["population"], round(float(last["population"]))) == ("20.0", 500)


def test_a_grid_of_four_parameters_with_runs_that_fail(tmp_path: Path) -> None:
    document = GRID + EXECUTION.format(runs=5, pack=8)
    summary = execute(tmp_path, document, GRID_SCENARIO, GRID_PROGRAM, runs=2)
    assert len(summary.records) == 32
    for name, verdict in verdicts(summary).items():
        folder = summary.campaign / name
        overshoot = json.loads((folder / "landing.json").read_text())["overshoot"]
        assert (verdict == "failed") == (overshoot > 0.6), name
        assert len((folder / "track.csv").read_text().splitlines()) == 401
    assert set(verdicts(summary).values()) == {"passed", "failed"}


COMMANDS = """\
  pre_command: /config/files/prepare.sh
  post_command: /config/files/finish.sh
  env:
  - GREETING: good day
  secondary_containers:
  - service:
      resources: {cpu: 1}
"""


def test_commands_and_a_service_written_for_containers(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    (folder / "files").mkdir(parents=True)
    document = GROWTH.replace("growth_model", "with_service") + EXECUTION.format(runs=1, pack=1)
    document = document.replace("**/files/*.py", "files/*") + COMMANDS
    (folder / "campaign.vast").write_text(document)
    (folder / "scenario.osc").write_text(GROWTH_SCENARIO)
    (folder / "files" / "growth.py").write_text(GROWTH_PROGRAM)
    scripts = {
        "prepare.sh": """
            if [ "$CONTAINER_NAME" = service ]; then
                mkdir -p ~/.cache && echo "$GREETING" > /dev/shm/answer && sleep 600 &
            else
                until [ -s /dev/shm/answer ]; do sleep 0.05; done
                cp /dev/shm/answer /out/_jobs/
            fi
            """,
        "finish.sh": """
            #!/bin/sh
            cp /dev/shm/answer "$1/answer.txt" && wc -l < "$1/out.csv" > "$1/lines"
            """,
    }
    for name, text in scripts.items():
        (folder / "files" / name).write_text(dedent(text).strip() + "\n")
        (folder / "files" / name).chmod(0o755)
    summary = run(folder / "campaign.vast", tmp_path / "out", select="test-fixed-values")
    assert verdicts(summary) == {"test-fixed-values/0": "passed"}
    result = summary.campaign / "test-fixed-values" / "0"
    assert (result / "answer.txt").read_text() == "good day\n"
    assert (result / "lines").read_text().strip() == "52"
    assert (result / "job" / "logs" / "system_service.log").is_file()
