"""Our reader of scenario parameters agrees with scenario-execution itself."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from robovast.base.errors import InputError
from robovast.common.scenario import get_scenario_parameters
from robovast.execution.local.process_environment import process_environment
from robovast.model.scenario import read_scenario, scenario_defaults
from robovast.model.scenario_values import refusal

HEADER = "import osc.helpers\nimport osc.robotics\n\n"
BODY = '    do serial:\n        log("hi")\n'
SCENARIOS = {
    "plain": "scenario a:\n    x: int = 1\n    y: float = 0.5\n    z: bool = true\n" + BODY,
    "strings": 'scenario a:\n    text: string = "a # b: c"  # comment\n' + BODY,
    "keywords": 'scenario a:\n    text: string = "a with: b"\n    y: int = 1\n' + BODY,
    "long": 'scenario a:\n    text: string = """a\nscenario b:\n    x: int"""\n' + BODY,
    "joined": "scenario a:\n    x: int \\\n    = 1\n    y: list of int = [1, # [\n2]\n" + BODY,
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


TYPES = """scenario a:
    whole: int = 3
    none: int
    number: float = 1.0
    short: length = 1m
    long: length = 1.0m
    turn: angle
    fast: bool = true
    word: string = "x"
    numbers: list of float
    ways: list of length
    given: pose_3d = pose_3d(position_3d(x: 1.0m))
    goal: pose_3d
    own: box = box(name: "a")
    owns: list of box
"""
STRUCT = "struct box:\n    name: string\n    size: length = 1.0m\n    layers: int = 3\n\n"
VALUES: list[Any] = [3, -3, 2.5, True, "4", None, [], [1, 2.5], ["x"], {}]
VALUES += [{"position": {"x": x}} for x in (2, 2.5, "a")] + [{"position": {"q": 1}}]
VALUES += [{"size": 2.5}, {"size": "a"}, {"layers": 2.5}, [{"size": 2}], [{"layers": 2.5}]]
TRY = """
import itertools, json, sys, tempfile, yaml
from scenario_execution.model.osc2_parser import OpenScenario2Parser
from unittest.mock import Mock
names, values = json.load(sys.stdin)
parser = OpenScenario2Parser(Mock())
model = None
def refused(name, value):
    import copy
    try:
        parser.apply_parameter_overrides(copy.deepcopy(model), {"a": {name: value}})
    except (ValueError, AttributeError, TypeError):
        return True
    return False
import py_trees
from scenario_execution.model.model_resolver import resolve_internal_model
model = parser.load_internal_model(parser.parse_file(sys.argv[1]), sys.argv[1])
resolve_internal_model(model, py_trees.composites.Sequence(name="", memory=True), Mock(), False)
print(json.dumps([[refused(name, value) for value in values] for name in names]))
"""


def test_values_are_refused_as_scenario_execution_does(tmp_path: Path) -> None:
    path = tmp_path / "a.osc"
    path.write_text(HEADER + STRUCT + TYPES + BODY)
    scenario = read_scenario(path)
    names = [parameter.name for parameter in scenario.parameters]
    result = subprocess.run(
        [process_environment(print) / "bin" / "python", "-c", TRY, path],
        input=json.dumps([names, VALUES]), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    ours = [[refusal(scenario, name, value) is not None for value in VALUES] for name in names]
    theirs = json.loads(result.stdout.splitlines()[-1])
    different = [
        (name, value, own)
        for name, row, real in zip(names, ours, theirs, strict=True)
        for value, own, their in zip(VALUES, row, real, strict=True)
        if own != their
    ]
    assert not different
    assert any(map(any, theirs))


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
