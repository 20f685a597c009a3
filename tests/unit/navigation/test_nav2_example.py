"""The example for Nav2 and Gazebo, as far as it goes without their image."""

from __future__ import annotations

import ast
import math
import os
import runpy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from robovast.evaluation.notebooks.data_dir import read_notebook
from robovast.model.scenario import read_scenario
from robovast_cli.main import command

FOLDER = Path(__file__).parents[3] / "configs" / "examples" / "nav2_gazebo"
EXAMPLE = FOLDER / "nav2_gazebo.vast"


def vast(*arguments: object) -> int:
    with pytest.raises(SystemExit) as caught:
        command().main(["-V", str(EXAMPLE), *map(str, arguments)])
    return int(caught.value.code or 0)


@pytest.fixture(scope="module")
def variants(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """Parameters by configuration, as `vast config generate` writes them."""
    folder = tmp_path_factory.mktemp("generated")
    assert vast("config", "generate", folder) == 0
    listed = yaml.safe_load((folder / "_transient" / "configurations.yaml").read_text())
    return {variant["name"]: variant["config"] for variant in listed["configs"]}


def test_every_configuration_has_what_the_three_containers_need(variants) -> None:
    assert len(variants) == 3 * 2 * 2 + 2 * 2
    names = {"map_file", "mesh_file", "start_pose", "goals"}
    assert all(names <= set(parameters) for parameters in variants.values())
    boxes = [parameters for name, parameters in variants.items() if name.startswith("boxes")]
    assert {parameters["trigger_distance"] for parameters in boxes} == {1.5, 2.5}
    assert all(len(parameters["obstacles"]) == 2 for parameters in boxes)


def test_boxes_appear_while_the_robot_is_away_from_them(variants) -> None:
    for parameters in variants.values():
        start = parameters["start_pose"]["position"]
        for box in parameters.get("obstacles", []):
            at = box["spawn_pose"]["position"]
            assert math.hypot(at["x"] - start["x"], at["y"] - start["y"]) > 0.5


def test_the_scenario_declares_what_is_varied_and_only_known_libraries() -> None:
    scenario = read_scenario(FOLDER / "scenario.osc")
    assert scenario.name == "drive"
    lines = (FOLDER / "scenario.osc").read_text().splitlines()
    imports = [line for line in lines if line.startswith("import ")]
    assert imports == [
        f"import osc.{n}" for n in ("helpers", "types", "robotics", "ros", "nav2", "gazebo")
    ]


def test_what_is_evaluated_is_recorded() -> None:
    """Each topic that postprocessing reads is among those of the scenario's recorder."""
    text = (FOLDER / "scenario.osc").read_text()
    document = yaml.safe_load(EXAMPLE.read_text())
    steps = document["results_processing"]["postprocessing"]
    options = {
        name: value for step in steps if isinstance(step, dict) for name, value in step.items()
    }
    action = f"/{options['rosbags_action_to_csv']['action']}/_action"
    read = {"/tf", "/tf_static", "/rosout", "/scenario_execution/snapshots"}
    read |= {*options["rosbags_to_csv"]["topics"], f"{action}/feedback", f"{action}/status"}
    assert [topic for topic in sorted(read) if f"'{topic}'" not in text] == []


def test_it_is_listed_and_drawn(tmp_path: Path, capsys) -> None:
    assert vast("config", "view", tmp_path / "out", "--config", "boxes-1-1-*") == 0
    pictures = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert pictures == ["boxes-1-1-1.svg", "boxes-1-1-2.svg"]
    assert vast("config", "list") == 0
    assert "16 configurations, 5 runs each: 80 in total" in capsys.readouterr().out


def test_a_job_is_prepared_with_three_containers_that_find_their_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    assert vast("exec", "local", "prepare-run", "-c", "boxes-1-1-1", folder) == 0
    assert os.access(folder / "run.sh", os.X_OK)
    jobs = sorted(folder.rglob("compose.yaml"))
    assert len(jobs) == 5
    services = yaml.safe_load(jobs[0].read_text())["services"]
    assert set(services) == {"robovast", "nav", "simulation"}
    environment = services["simulation"]["environment"]
    assert environment["CONTAINER_NAME"] == "simulation"
    config = jobs[0].parent / "config"
    monkeypatch.setenv("ROBOVAST_CONFIG_DIR", str(config))
    monkeypatch.setenv("SCENARIO_PARAMETER_FILE", environment["SCENARIO_PARAMETER_FILE"])
    found = runpy.run_path(str(config / "files" / "job.py"))["parameters"]()
    assert all((config / found[name]).is_file() for name in ("map_file", "mesh_file"))


def test_a_dry_run_prints_a_campaign_with_its_files(capsys) -> None:
    assert vast("exec", "cluster", "run", "--dry-run") == 0
    campaign = yaml.safe_load(capsys.readouterr().out)
    assert campaign["kind"] == "Campaign"
    files = set(campaign["spec"]["source"]["inline"]["files"])
    assert {"plans/ward.fpm", "plans/ward.variation", "analysis/run.ipynb"} <= files
    assert {
        f"files/{path.name}" for path in (FOLDER / "files").iterdir() if path.is_file()
    } <= files


@pytest.mark.parametrize("path", sorted(FOLDER.glob("files/*.py")), ids=lambda path: path.name)
def test_its_programs_are_python(path: Path) -> None:
    ast.parse(path.read_text(), path.name)


@pytest.mark.parametrize("name", ["floor_plan.sdf", "box.sdf.xacro"])
def test_its_models_are_sdf(name: str) -> None:
    assert ElementTree.parse(FOLDER / "files" / name).getroot().tag == "sdf"  # noqa: S314  # ours


@pytest.mark.parametrize(
    ("notebook", "data"),
    [("run", "boxes-1/0"), ("config", "boxes-1"), ("campaign", ".")],
)
def test_its_notebooks_read_what_postprocessing_leaves(
    notebook: str, data: str, tmp_path: Path
) -> None:
    for run in (0, 1):
        write_run(tmp_path / "boxes-1" / str(run))
    names = execute(FOLDER / "analysis" / f"{notebook}.ipynb", tmp_path / data)
    if notebook == "campaign":
        assert names["by_config"].loc["boxes-1"].to_dict() == {
            "passed": 1.0,
            "duration": 3.0,
            "driven": 2.0,
        }
        assert names["by_trigger"].loc[1.5, "size"] == 2
    elif notebook == "config":
        assert names["runs"]["driven"].tolist() == [2.0, 2.0]
    else:
        assert names["status"] == "passed"
        assert names["standing"] == 1.0


def execute(path: Path, data_dir: Path) -> dict[str, Any]:
    """The names that a notebook's cells leave."""
    names: dict[str, Any] = {}
    for cell in read_notebook(path.read_bytes(), data_dir).cells:
        if cell.cell_type == "code":
            exec(cell.source, names)  # noqa: S102  # ours
    return names


def write_run(folder: Path) -> None:
    """A run that drove two metres, and stood still for a second."""
    folder.mkdir(parents=True)
    (folder / "test.xml").write_text(
        '<testsuite tests="1" failures="0" errors="0" time="12.5">'
        '<testcase classname="tests.scenario" name="drive" time="12.5"/></testsuite>'
    )
    (folder / "poses.csv").write_text(
        "frame,timestamp,position.x,position.y,position.z,"
        "orientation.roll,orientation.pitch,orientation.yaw\n"
        + "".join(
            f"base_link,{t}.0,{x}.0,0.0,0.0,0.0,0.0,0.0\n" for t, x in enumerate([0, 1, 1, 2])
        )
    )
    (folder / "rosout.csv").write_text(
        "timestamp,stamp,level,level_name,name,msg,file,function,line\n"
        "1.0,1.0,30,WARN,controller_server,Slow,c.cpp,f,1\n"
    )
    config = folder.parent / "_config"
    config.mkdir(exist_ok=True)
    pose = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}}
    values = {
        "map_file": "ward.yaml",
        "start_pose": pose,
        "goals": [pose],
        "obstacles": [{"spawn_pose": pose}],
        "trigger_distance": 1.5,
    }
    (config / "scenario.config").write_text(yaml.safe_dump({"drive": values}))
