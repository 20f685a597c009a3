"""Our reader of scenario parameters agrees with scenario-execution itself."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
import yaml

from robovast.base.errors import InputError
from robovast.common.scenario import get_scenario_parameters
from robovast.execution.local.process_environment import process_environment
from robovast.model.scenario import read_scenario, scenario_defaults

HEADER = "import osc.helpers\nimport osc.robotics\n\n"
BODY = '    do serial:\n        log("hi")\n'
SCENARIOS = {
    "plain": "scenario a:\n    x: int = 1\n    y: float = 0.5\n    z: bool = true\n" + BODY,
    "strings": 'scenario a:\n    text: string = "a # b: c"  # comment\n' + BODY,
    "none": "scenario a:\n" + BODY,
    "comments": "# scenario b:\nscenario a:  # why\n\n    # x: int\n    y: int = 2\n" + BODY,
    "variables": "scenario a:\n    var v: int = 3\n    p: int = 4\n" + BODY,
    "lists": "scenario a:\n    names: list of string = ['a', 'b']\n" + BODY,
    "struct": "scenario a:\n    pose: pose_3d = pose_3d(position: position_3d(x: 1m))\n" + BODY,
    "crlf": 'scenario a:\r\n    x: int = 1\r\n    do serial:\r\n        log("hi")\r\n',
    "time": "scenario a:\n    t: time = 5s\n    timeout(10s)\n" + BODY,
    "deep": "scenario a:\n    x: int = 1\n    do serial:\n        parallel:\n"
    '            log("x")\n            log("y: z")\n',
    "wide": 'scenario a:\n        x: int = 1\n        do serial:\n            log("hi")\n',
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_parameters_are_those_of_scenario_execution(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.osc"
    path.write_bytes((HEADER + SCENARIOS[name]).encode())
    assert set(scenario_defaults(path)) == _asked(path, tmp_path / "template.yaml")


def _asked(path: Path, template: Path) -> set[str]:
    program = process_environment(print) / "bin" / "scenario_execution"
    options = ["--create-scenario-parameter-file-template", "--scenario-parameter-file", template]
    result = subprocess.run([program, path, *options], capture_output=True, text=True, check=False)
    assert template.exists(), result.stdout + result.stderr
    data = yaml.safe_load(template.read_text()) or {}
    return set((data.get("a") or {}).keys())


def test_defaults_and_places(tmp_path: Path) -> None:
    path = tmp_path / "a.osc"
    path.write_text(HEADER + SCENARIOS["plain"])
    assert scenario_defaults(path) == {"x": 1, "y": 0.5, "z": True}
    assert get_scenario_parameters(path)["a"][0] == {"name": "x", "type": "int", "is_list": False}
    first = read_scenario(path).parameters[0]
    assert (first.name, first.type, first.default_text, first.line) == ("x", "int", "1", 5)


def test_no_scenario_and_no_file(tmp_path: Path) -> None:
    (tmp_path / "a.osc").write_text("import osc.helpers\n")
    with pytest.raises(InputError, match="declares no scenario"):
        read_scenario(tmp_path / "a.osc")
    with pytest.raises(InputError, match="there is no scenario file"):
        read_scenario(tmp_path / "b.osc")
