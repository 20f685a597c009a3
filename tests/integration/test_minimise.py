"""`vast minimise`: the fewest items and the mildest values that still fail, whatever dies."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from support.campaigns.local import run
from support.patience import eventually

VAST = Path(sys.executable).with_name("vast")

SCENARIO = """\
import osc.helpers

scenario test:
    level: int = 0
    boxes: list of string
    here: common
    do serial:
        run_process("bash " + here.get_scenario_file_directory() + "/files/step.sh"
            + " " + here.get_output_directory() + " %s" % level + " %s" % boxes)
"""
DOCUMENT = """\
version: 1
metadata: {name: crowded}
configuration:
- name: hall
  parameters:
  - boxes: [-a-, -b-]
  variations:
  - ParameterVariationList: {name: level, values: [1, 3]}
execution: {scenario_file: scenario.osc, run_files: ['files/*'], seed: 3}
"""
FAILS = """\
[[ $* != *-a-* ]] || (( $2 < 2 )) || { echo "hit after $2.5 s" >&2; sleep 0.2; exit 1; }
"""

QUICK = ["--bad", "0.9", "--jobs", "2"]
"""Two equal runs decide a step."""
STEPS = [
    {},
    {"boxes": 0},
    {"boxes": 1},
    {"boxes": 1, "level": 1},
    {"boxes": 1, "level": 2},
    {"boxes": 0, "level": 2},
]


def campaign(folder: Path, script: str = FAILS) -> Path:
    """Folder of a campaign whose `hall-2` fails."""
    (folder / "files").mkdir(parents=True)
    (folder / "files" / "step.sh").write_text(script)
    (folder / "scenario.osc").write_text(SCENARIO)
    (folder / "test.vast").write_text(DOCUMENT)
    return run(folder / "test.vast", folder / "out", jobs=2).campaign


def minimise(folder: Path, *options: str | Path) -> tuple[int, str]:
    """Exit code and what is said; results are in `minimised` beside the campaign's folder."""
    command = [VAST, "minimise", folder, *QUICK, *options]
    done = subprocess.run(command, cwd=folder.parents[2], capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def record(folder: Path) -> dict[str, Any]:
    (path,) = (folder.parents[2] / "minimised").glob("*/minimise.json")
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def test_what_is_left_is_needed_and_runs_again(tmp_path: Path) -> None:
    failing = campaign(tmp_path / "in") / "hall-2" / "0"
    code, said = minimise(failing)
    assert code == 0, said
    assert "hall-2/0 still fails, in 2 of 2 runs (95 % interval 13 – 100 %): " in said
    assert "boxes      1 of 2 items       0 items\nlevel      2             3    1\n" in said
    found = record(failing)
    assert found["minimal"]["parameters"] == {"boxes": ["-a-"], "level": 2}
    assert found["end"] == "minimal"
    assert [step["changes"] for step in found["steps"]] == STEPS
    assert {step["runs"] for step in found["steps"]} == {2}
    (line,) = (line for line in said.splitlines() if line.startswith("Reproduce: vast "))
    again = [VAST, *line.removeprefix("Reproduce: vast ").split()]
    done = subprocess.run(again, cwd=failing.parents[2], capture_output=True, text=True)
    assert (done.returncode, "same verdict (failed)" in done.stdout) == (0, True)


def test_kill_9_and_resume_take_the_same_way(tmp_path: Path) -> None:
    held = f"[[ $1 != */hall-2-m3/* ]] || sleep 600\n{FAILS}"
    failing = campaign(tmp_path / "in", held) / "hall-2" / "0"
    place = failing.parents[2] / "minimised"
    command = [VAST, "minimise", failing, *QUICK, "--out", place]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    eventually(lambda: list(place.glob("*/hall-2-m2/0/run.json")))
    process.kill()
    process.wait()
    (folder,) = place.iterdir()
    (folder / "_config/files/step.sh").write_text(FAILS)
    code, said = minimise(failing, "--resume", folder)
    assert code == 0, said
    found = record(failing)
    assert [step["changes"] for step in found["steps"]] == STEPS
    runs = [json.loads(path.read_text()) for path in folder.glob("hall-2*/*/run.json")]
    # A worker that would idle may start a run of which the one under way takes away the need.
    assert 2 * len(STEPS) <= len(runs) <= 3 * len(STEPS)
    assert max(one["attempt"] for one in runs) == 1


def test_a_budget_ends_it_and_more_goes_on(tmp_path: Path) -> None:
    failing = campaign(tmp_path / "in") / "hall-2" / "0"
    code, said = minimise(failing, "--budget", "4")
    assert (code, record(failing)["end"]) == (0, "budget")
    assert "The budget is used up; less extreme values may exist. Continue: vast minimise" in said
    (folder,) = (failing.parents[2] / "minimised").iterdir()
    steps = folder / "_transient/configurations.yaml"
    text = steps.read_text()
    for old, new, why in (
        ("name: hall-2-m1\n", "name: ../../hall\n", "is damaged"),
        ("level: 3\n", "level: 9\n", "was edited"),
        ("configs:", "configs: []\nothers:", "has no configuration `hall-2`"),
        ("name: hall-2-m1\n", "label: x\n", "is damaged"),
    ):
        assert old in text
        steps.write_text(text.replace(old, new))
        code, said = minimise(failing, "--resume", folder)
        assert (code, said.count("error: "), why in said) == (2, 1, True), said
    steps.write_text(text)
    assert len(list(failing.parents[2].glob("**/hall*/*/run.json"))) == 2 + 4
    code, said = minimise(failing, "--resume", folder, "--budget", "6")
    assert (code, record(failing)["end"]) == (0, "budget")
    assert "boxes      1 of 2 items       0 items\nlevel      3                  none\n" in said
    (line,) = (line for line in said.splitlines() if "Continue: " in line)
    assert line.endswith(" --budget=12")
    words = [VAST, *shlex.split(line.partition("Continue: vast ")[2]), *QUICK]
    done = subprocess.run(words, cwd=failing.parents[2], capture_output=True, text=True)
    assert (done.returncode, record(failing)["end"]) == (0, "minimal"), done.stdout
    resume = [VAST, "exec", "local", "run", "--resume", folder]
    done = subprocess.run(resume, capture_output=True, text=True)
    assert (done.returncode, "hint: continue it with `vast minimise --resume`" in done.stderr) == (
        2,
        True,
    )


def test_what_cannot_be_minimised_is_one_message(tmp_path: Path) -> None:
    sound = campaign(tmp_path / "in")
    failing = sound / "hall-2" / "0"
    for words, said in (
        (
            [sound / "hall-1" / "0"],
            "hall-1/0: passed, so there is no failure to reduce\nhint: name a failed run",
        ),
        (
            [sound / "hall-2" / "9"],
            "hall-2/9: there is no such folder\nhint: name the folder of a run",
        ),
        ([failing, "--good", "0.5", "--bad", "0.2"], "--good must be less than --bad"),
        ([failing, "--resume", sound], "hint: use `--resume` with a folder that `vast minimise`"),
        ([failing, "--out", sound / "inside"], "which a replay leaves as it is"),
    ):
        code, text = minimise(*words)
        assert (code, text.count("error: "), said in text) == (2, 1, True), text
    path = failing / "run.json"
    text = path.read_text()
    path.write_text(text.replace('"failed"', '"errored"'))
    code, said = minimise(failing)
    assert (code, "so the run does not show a fault of the robot" in said) == (2, True)
    path.write_text(text)
    (sound / "_config/files/step.sh").unlink()
    code, said = minimise(failing)
    assert (code, "files of its campaign are gone: _config/files/step.sh" in said) == (2, True)
    assert not (tmp_path / "in" / "minimised").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("exit 0\n", "0 of 2 runs failed so with its parameters, the first with its seed"),
        ('echo "other" >&2; sleep 0.2; exit 1\n', "(fails otherwise: run_process: other)"),
    ],
)
def test_a_failure_that_does_not_come_again_is_said(tmp_path: Path, change: str, said: str) -> None:
    failing = campaign(tmp_path / "in") / "hall-2" / "0"
    (failing.parents[1] / "_config/files/step.sh").write_text(change)
    code, text = minimise(failing)
    assert (code, text.count("error: "), said in text) == (2, 1, True), text
