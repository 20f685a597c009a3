"""Floor plans by a generator in a container, instead of the one in this process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from robovast_testbed.docker import Docker
from support.campaigns.local import EXAMPLES

VAST = Path(sys.executable).with_name("vast")
IMAGE = "localhost:5000/stand-in-generator:1"
GENERATOR = r"""#!/bin/bash
# Any plan becomes a free square of 4 x 4 m; the map's header says who made it, and when.
set -eu
name=$(basename "$1" .fpm) out=$2
if grep -q "no such space" "$1"; then echo "$name.fpm:1: unknown space" >&2; exit 3; fi
if grep -q "no mesh" "$1"; then touch "$out/$name.yaml"; exit; fi
mkdir "$out/maps" "$out/mesh"
{ printf 'P5\n# %s by the stand-in, %s\n80 80\n255\n' "$name" "$(date +%N)"
  head -c 6400 /dev/zero | tr '\0' '\376'; } > "$out/maps/$name.pgm"
printf 'image: %s.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\n' "$name" > "$out/maps/$name.yaml"
echo "solid $name" > "$out/mesh/$name.stl"
echo '{"@graph": []}' > "$out/floorplan.json"
"""
SCENARIO = """\
scenario drive:
    map_file: string = ""
    mesh_file: string = ""
    start_pose: pose_3d
    goal_pose: pose_3d
    do serial:
        wait elapsed(1s)
"""
DOCUMENT = f"""\
version: 1
configuration:
- name: square
  variations:
  - FloorplanGeneration:
      name: [map_file, mesh_file]
      floorplans: [square.fpm]
      container: {IMAGE}
  - PathVariationRandom: {{start_pose: "@start_pose", goal_poses: "@goal_pose", path_length: 2.0}}
execution: {{scenario_file: drive.osc, image: any}}
"""


@pytest.fixture(scope="module")
def generator(docker_daemon: Docker, slim_image: str, tmp_path_factory) -> Docker:
    """A Docker daemon with a generator that fulfils the contract by the least."""
    folder = tmp_path_factory.mktemp("generator")
    (folder / "generate").write_text(GENERATOR)
    (folder / "generate").chmod(0o755)
    recipe = f'FROM {slim_image}\nCOPY generate /generate\nENTRYPOINT ["/generate"]\n'
    (folder / "Dockerfile").write_text(recipe)
    docker_daemon.run("build", "--network", "none", "--tag", IMAGE, folder)
    return docker_daemon


@pytest.fixture
def document(tmp_path: Path) -> Path:
    """A document whose one floor plan a container makes."""
    (tmp_path / "drive.osc").write_text(SCENARIO)
    (tmp_path / "square.fpm").write_text("a language of its own\n")
    (tmp_path / "square.vast").write_text(DOCUMENT)
    return tmp_path / "square.vast"


@pytest.fixture
def vast(generator: Docker, document: Path, tmp_path: Path):
    """Type `vast …` on the document; a cache of the test's own."""

    def run(*words: object, **environment: str) -> subprocess.CompletedProcess[str]:
        cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
        env = {**os.environ, **generator.env, **cache, **environment}
        command = [str(VAST), "-V", str(document), *map(str, words)]
        return subprocess.run(command, env=env, capture_output=True, text=True, check=False)

    return run


def test_a_container_makes_what_a_configuration_uses_once(vast, tmp_path: Path) -> None:
    def made(name: str, *options: str) -> Path:
        done = vast("config", "generate", tmp_path / name, *options)
        assert done.returncode == 0, done.stderr
        return tmp_path / name / "square-1-1/_config/floorplans/square/maps/square.pgm"

    first = made("first")
    assert b"square by the stand-in" in first.read_bytes()
    assert first.stat().st_uid == os.getuid()
    assert made("again").read_bytes() == first.read_bytes()
    assert made("anew", "--no-cache").read_bytes() != first.read_bytes()


@pytest.mark.parametrize(
    ("model", "says"),
    [
        ("no such space\n", "square.fpm:1: unknown space"),
        (
            "no mesh\n",
            "wrote square.yaml\nhint: let the generator write the mesh as one `square.stl` below ",
        ),
    ],
)
def test_a_generators_own_words_and_what_it_left_out_are_told(
    vast, document: Path, model: str, says: str
) -> None:
    (document.parent / "square.fpm").write_text(model)
    done = vast("config", "list")
    assert done.returncode == 2
    assert "configuration `square`: FloorplanGeneration: " in done.stderr
    assert says in done.stderr


def test_a_missing_engine_or_image_is_named(vast, document: Path, tmp_path: Path) -> None:
    done = vast("config", "list", PATH=str(tmp_path))
    assert done.returncode == 3
    assert "configuration `square`" in done.stderr
    assert "neither docker nor podman is installed" in done.stderr
    assert "does not answer" in vast("config", "list", DOCKER_HOST="unix:///none").stderr
    document.write_text(DOCUMENT.replace(IMAGE, "localhost:5000/none:1"))
    assert "localhost:5000/none:1 is not on this machine" in vast("config", "list").stderr


def test_a_cluster_is_refused_before_anything_is_sent(vast) -> None:
    done = vast("exec", "cluster", "run", "--dry-run")
    assert done.returncode == 3
    assert "configuration `square`" in done.stderr
    assert "a cluster does not start such containers" in done.stderr


def test_a_drawn_plan_is_handed_to_the_container(vast, document: Path) -> None:
    plans = EXAMPLES / "floor_plans" / "plans"
    text = DOCUMENT.replace("FloorplanGeneration", "FloorplanVariation").replace(
        "floorplans: [square.fpm]",
        f"variation_files: [{plans}/office.variation]\n      num_variations: 2",
    )
    document.write_text(text)
    done = vast("config", "list", "-o", "json")
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)) == 2
