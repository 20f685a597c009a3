"""The example with nodes of ROS 2 in the slim image: on this machine and on a cluster."""

from __future__ import annotations

import csv
import json
import shlex
from pathlib import Path

import pytest
from robovast_testbed import containerd, images
from support.kube.lab import Lab, files
from support.pages import ROOT, code_blocks

OUTCOMES = {"drive-1-1-2-2/0": "arrived", "drive-2-1-2-2/0": "no way to the goal"}
SELECT = ("-c", "drive-?-1-2-2", "--image", images.ROS)
VERDICT = {"arrived": "passed"}


@pytest.fixture
def docker_lab(lab: Lab, docker_daemon, ros_image: str) -> Lab:
    """A namespace of a cluster and a Docker daemon, both with the image that has ROS 2."""
    containerd.of(lab.cluster.bed).load(images.ros_archive())
    lab.env = {**lab.env, **docker_daemon.env}
    return lab


def drives(campaign: Path) -> dict[str, dict[str, str]]:
    """What each drive wrote about itself, by run."""
    return {
        path.parent.relative_to(campaign).as_posix(): row
        for path in campaign.glob("*/*/outcome.csv")
        for row in csv.DictReader(path.read_text().splitlines())
    }


def documented() -> list[list[str]]:
    """The words of the README's commands for containers, and of nothing else."""
    blocks = code_blocks("configs/examples/robot_navigation/README.md", "bash")
    (block,) = [block for block in blocks if "--runtime docker" in block]
    lines = [shlex.split(line, comments=True) for line in block.splitlines()]
    return [[str(ROOT / w) if w.startswith("configs/") else w for w in line] for line in lines]


def test_a_robot_drives_in_docker_and_on_a_cluster_as_the_readme_says(docker_lab: Lab) -> None:
    """The same file, drives (to the last bit) and files; the tables and the graph come home too."""
    lab, results = docker_lab, docker_lab.folder / "results"
    build, locally, on_cluster, download = (words for _, *words in documented())
    assert build == ["--slim", "--", "--build-arg", "ROS_WHEELS=true"]  # as the image was built
    lab.vast(*locally, *SELECT, code=1)
    (mine,) = results.iterdir()
    lab.vast(*on_cluster, "-n", lab.namespace, *SELECT, code=1)
    lab.vast(*download, "-n", lab.namespace)
    (theirs,) = set(results.iterdir()) - {mine}
    assert drives(mine) == drives(theirs)
    assert {run: row["outcome"] for run, row in drives(mine).items()} == OUTCOMES
    assert lab.verdicts(mine) == lab.verdicts(theirs)
    assert lab.verdicts(mine) == {run: VERDICT.get(o, "failed") for run, o in OUTCOMES.items()}
    assert files(mine) == files(theirs)
    lab.vast("results", "postprocess", "-r", theirs)
    asked = lab.vast("results", "sparql", "failure-rate", "-r", theirs, "-o", "json").stdout
    rates = {Path(row["env_model"]).stem: float(row["result"]) for row in json.loads(asked)}
    assert rates == {"depot": 0.0, "flat": 100.0}
