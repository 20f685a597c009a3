"""The examples with nodes of ROS 2, from a campaign to tables, queries and notebooks."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from PIL import Image
from robovast_testbed import debian
from support.campaigns import local
from support.campaigns.local import EXAMPLES
from support.pages import ROOT, code_blocks

from robovast.evaluation.drive.drives import Drives

VAST = Path(sys.executable).with_name("vast")
NAVIGATION = EXAMPLES / "robot_navigation" / "robot_navigation.vast"
BASIC = EXAMPLES / "ros2_basic" / "ros2_basic.vast"
MANY_OBSTACLES = "drive-?-1-2-?"
OUTCOMES = {
    "drive-1-1-2-1": "collision",
    "drive-1-1-2-2": "arrived",
    "drive-2-1-2-1": "collision",
    "drive-2-1-2-2": "no way to the goal",
}


def vast(*arguments: object, **environment: str) -> str:
    done = subprocess.run(
        [str(VAST), *map(str, arguments)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0 or "exec" in arguments, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def ros_environment() -> str:
    """Folder of the environment that the README says how to make."""
    return local.ros_environment()


def execute(path: Path, out: Path, ros_environment: str, select: str) -> Path:
    """Folder of a campaign that was executed in part."""
    options = ("--runtime", "process", "-c", select, out)
    vast("-V", path, "exec", "local", "run", *options, ROBOVAST_PROCESS_ENV=ros_environment)
    (campaign,) = out.iterdir()
    return campaign


@pytest.fixture(scope="module")
def campaign(ros_environment: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four drives, postprocessed."""
    out = tmp_path_factory.mktemp("navigation") / "results"
    folder = execute(NAVIGATION, out, ros_environment, MANY_OBSTACLES)
    vast("results", "postprocess", "-r", out)
    return folder


def query(campaign: Path, sql: str) -> list[dict[str, object]]:
    return json.loads(vast("results", "query", sql, "-r", campaign, "-o", "json"))


def test_the_readme_of_the_example_leads_from_a_drive_to_its_results(
    ros_environment: str, tmp_path: Path
) -> None:
    """Its commands as they stand there, with fewer drives; containers are for other tests."""
    blocks = code_blocks("configs/examples/robot_navigation/README.md", "bash")
    start, first, asked, containers, camera = blocks
    assert start.startswith("scripts/example --robot ")  # docs/tutorials/first-robot.md, too
    assert containers.startswith("container/build.sh ")  # test_robot_in_containers.py
    for name in ("configs", "scripts", "container", "src"):
        (tmp_path / name).symlink_to(ROOT / name)
    made, run = first.splitlines()
    assert made == "export ROBOVAST_PROCESS_ENV=$(scripts/ros-environment)"
    *told, shown = asked.splitlines()
    assert shown == "vast evaluation gui -r results"  # what scripts/example does, too
    lines = [f"{run} -c drive-2-1-2-1 || [ $? = 1 ]", *told, camera.strip() + " || [ $? = 1 ]"]
    path = f"{VAST.parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euc", "\n".join(lines)],
        cwd=tmp_path,
        env={**os.environ, "ROBOVAST_PROCESS_ENV": ros_environment, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for expected in (
        "1 run: 1 failed",
        "plans/flat.fpm",
        "collision",
        "2 runs: 1 passed, 1 failed",
    ):
        assert expected in done.stdout


def test_the_way_from_a_grid_to_a_failure_map(ros_environment: str, tmp_path: Path) -> None:
    """Every command of docs/how-to/search.md about this example, with fewer drives."""
    (block,) = [b for b in code_blocks("docs/how-to/search.md", "bash") if "configs/examples" in b]
    folder = tmp_path / "configs" / "examples" / "robot_navigation"
    shutil.copytree(NAVIGATION.parent, folder)
    path = folder / "failure_map.vast"
    text = path.read_text().replace("per_batch: 6", "per_batch: 2\n  max_errors: 0")
    path.write_text(text.replace("batches: 8", "batches: 2").replace("runs: 3 ", "runs: 1 "))
    export, *lines = block.splitlines()
    assert export == "export ROBOVAST_PROCESS_ENV=$(scripts/ros-environment)"
    answers = []
    for line in lines:
        made = next(iter((tmp_path / "results").glob("robot-failure-map-*")), tmp_path)
        _, *words = [str(made) if "-2026-" in word else word for word in shlex.split(line)]
        with contextlib.chdir(tmp_path):
            answers.append(vast(*words, ROBOVAST_PROCESS_ENV=ros_environment))
    _, _, searched, *_, critical, points, _ = answers
    assert searched.count("FloorplanGeneration: flat\n") <= 2, "first tried, then executed"
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert "margin" in critical
    assert points.startswith("speed,margin,boxes,failure_rate,low,high")
    assert len(points.splitlines()) == 513


@pytest.mark.parametrize(("path", "count"), [(NAVIGATION, 16), (BASIC, 3)])
def test_the_configurations_of_an_example_are_listed(path: Path, count: int) -> None:
    listed = json.loads(vast("-V", path, "config", "list", "-o", "json"))
    assert len(listed) == count


def test_a_drive_ends_as_the_readme_says(campaign: Path) -> None:
    rows = query(campaign, "SELECT config, outcome FROM outcome")
    assert {row["config"]: row["outcome"] for row in rows} == OUTCOMES
    rows = query(campaign, "SELECT config FROM runs WHERE verdict = 'passed'")
    assert [row["config"] for row in rows] == ["drive-1-1-2-2"]


def test_what_was_recorded_agrees_with_what_was_simulated(campaign: Path) -> None:
    (row,) = query(
        campaign,
        'SELECT o.x, o.y, max_by(p."position.x", p.timestamp) AS bag_x,'
        ' max_by(p."position.y", p.timestamp) AS bag_y, count(*) AS poses,'
        " any_value(o.seconds) AS s"
        " FROM outcome o JOIN poses p USING (config, run) WHERE config = 'drive-1-1-2-2'"
        " GROUP BY o.x, o.y",
    )
    assert (row["bag_x"], row["bag_y"]) == pytest.approx((row["x"], row["y"]), abs=0.001)
    assert row["poses"] == round(float(str(row["s"])) * 10) + 1
    logged = query(campaign, "SELECT config FROM rosout WHERE level_name = 'ERROR' ORDER BY config")
    assert [row["config"] for row in logged] == [
        config for config, outcome in OUTCOMES.items() if outcome != "arrived"
    ]


def drive(
    campaign: Path,
    ros_environment: str,
    config: str,
    seed: object,
    out: Path,
    *,
    camera: float = 0.0,
    before: str = "",
) -> tuple[str, str]:
    """Hash of the trajectory of one more drive, without RoboVAST, and what it says.

    `before` is executed before it.
    """
    told = yaml.safe_load((campaign / config / "_config" / "scenario.config").read_text())
    given = {"speed": 0.8, "diameter": 0.4, "pace": 0, "limit": 60, **told["navigate"]}
    words = {name.removesuffix("_pose"): value for name, value in given.items()}
    words |= {"map": campaign / config / "_config" / given["map_file"], "output": out}
    words["camera"] = camera
    out.mkdir()
    files = campaign / "_config" / "files"
    start = f"{before}\nimport runpy, sys; sys.path.insert(0, {str(files)!r})\n"
    start += "runpy.run_module('navigate', run_name='__main__')"
    options = [word for name, value in words.items() for word in (f"--{name}", value)]
    done = subprocess.run(
        [str(word) for word in (f"{ros_environment}/bin/python", "-c", start, *options)],
        env={**os.environ, "ROBOVAST_SEED": str(seed)},
        capture_output=True,
        text=True,
        check=False,
    )
    (row,) = csv.DictReader((out / "outcome.csv").read_text().splitlines())
    return row["trajectory"], done.stderr


def test_no_drive_begins_in_a_wall(ros_environment: str, tmp_path: Path) -> None:
    """The start of sweep.vast is 2.5 cm from a wall, and the robot is put down to 2 cm."""
    path = NAVIGATION.with_name("sweep.vast")
    folder = execute(path, tmp_path / "results", ros_environment, "flat-1-1-1-2-1")
    ends = [
        float(row["seconds"])
        for path in folder.glob("flat-*/*/outcome.csv")
        for row in csv.DictReader(path.read_text().splitlines())
    ]
    assert len(ends) == 5
    assert min(ends) > 0.2
    program = f"""
import sys
from pathlib import Path
sys.path.insert(0, {str(NAVIGATION.parent / "files")!r})
from grid import Grid
from world import World
(path,) = Path({str(folder)!r}).glob("flat-*/_config/maps/flat.yaml")
grid, start = Grid.read(path), (1.525, -1.525, 3.14)
for seed in range(100):
    world = World(grid, [], start, 0.2, seed)
    x, y, _ = world.place()
    assert grid.clearance(x, y) >= 0.2, (x, y)
    world.move(0.0, 0.0)
    assert world.push < 60.0, (x, y)
"""
    subprocess.run([f"{ros_environment}/bin/python", "-c", program], check=True, timeout=120)


def test_a_seed_is_a_drive(campaign: Path, ros_environment: str, tmp_path: Path) -> None:
    """To the last bit; another seed is another one."""
    config, told = "drive-2-1-2-1", "SELECT config, seed, trajectory FROM outcome"
    (row,) = [row for row in query(campaign, told) if row["config"] == config]
    again, other = (
        drive(campaign, ros_environment, config, seed, tmp_path / str(seed))[0]
        for seed in (row["seed"], int(str(row["seed"])) + 1)
    )
    assert again == row["trajectory"] != other


def test_a_camera_records_what_is_ahead_and_changes_no_drive(
    campaign: Path, ros_environment: str, tmp_path: Path
) -> None:
    """To the last bit, also where nothing draws, which is said in one line."""
    debian.require(debian.OSMESA)
    config = "drive-2-1-2-1"
    told = "SELECT config, seed, trajectory, seconds FROM outcome"
    (row,) = [row for row in query(campaign, told) if row["config"] == config]
    nothing_draws = "import ctypes.util; ctypes.util.find_library = lambda name: None"
    with_it, without = (
        drive(campaign, ros_environment, config, row["seed"], tmp_path / name, **given)
        for name, given in (
            ("seen", {"camera": 5.0}),
            ("blind", {"camera": 5.0, "before": nothing_draws}),
        )
    )
    assert with_it[0] == without[0] == row["trajectory"]
    (said,) = [line for line in without[1].splitlines() if "no pictures of the camera" in line]
    assert "apt-get install libosmesa6" in said
    assert "no pictures" not in with_it[1]
    seen, blind = (Drives(tmp_path.resolve()).drive(f"{n}/rosbag2", {}) for n in ("seen", "blind"))
    found = seen.pictures(0)
    assert len(found.frames) == int(float(str(row["seconds"])) * 5) + 1
    images = [Image.open(io.BytesIO(content)).convert("RGB") for content in found.content]
    assert {image.size for image in images} == {(320, 240)}
    assert all(len(image.getcolors(320 * 240) or ()) > 50 for image in images)
    assert len(set(found.content)) > len(images) // 2
    assert "camera" not in blind.overview().topics


def test_failures_are_counted_by_floor_plan(campaign: Path) -> None:
    text = vast("results", "sparql", "failure-rate", "-r", campaign, "-o", "json")
    found = {Path(row["env_model"]).stem: float(row["result"]) for row in json.loads(text)}
    assert found == {"depot": 50.0, "flat": 100.0}


@pytest.mark.parametrize(
    ("scope", "folder", "pictures"),
    [("run", "drive-1-1-2-2/0", 1), ("config", "drive-1-1-2-2", 1), ("campaign", ".", 3)],
)
def test_a_notebook_draws_the_drives(
    campaign: Path, tmp_path: Path, scope: str, folder: str, pictures: int
) -> None:
    request = {
        "notebook": str(campaign / "_config" / "analysis" / f"{scope}.ipynb"),
        "data_dir": str(campaign / folder),
        "batch": None,
        "timeout": 600,
    }
    (tmp_path / "request.json").write_text(json.dumps(request))
    command = [sys.executable, "-m", "robovast.evaluation.notebooks.child", str(tmp_path)]
    subprocess.run(command, capture_output=True, check=True)
    assert json.loads((tmp_path / "result.json").read_text())["fault"] == ""
    shown = (tmp_path / "output.html").read_text().count('src="data:image/svg+xml')
    assert shown == pictures


def test_a_listener_hears_every_message(ros_environment: str, tmp_path: Path) -> None:
    campaign = execute(BASIC, tmp_path / "results", ros_environment, "chat-3")
    for run in ("0", "1"):
        lines = (campaign / "chat-3" / run / "heard.csv").read_text().splitlines()[1:]
        assert [int(line.split(",")[0]) for line in lines] == list(range(20))
