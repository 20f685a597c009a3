"""Without the extra: one clear message, and everything that needs none of it still works."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

WITHOUT = """
import sys
sys.modules.update(dict.fromkeys({missing}))  # as if they were not installed
from robovast_cli.main import main
sys.argv = ["vast", *{arguments}]
main()
"""


def vast_without(packages: list[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    program = WITHOUT.format(missing=packages, arguments=arguments)
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)


PATHS = {"PathVariationRandom": {"start_pose": "@start_pose", "map_file": "m", "path_length": 1.0}}
PLANS = {"FloorplanGeneration": {"name": ["map_file"], "floorplans": ["room.fpm"]}}


@pytest.mark.parametrize(
    ("variation", "missing", "first"),
    [(PATHS, "scipy", "PathVariationRandom"), (PLANS, "textx", "FloorplanGeneration")],
)
def test_the_extra_is_named(document, folder: Path, variation, missing: str, first: str) -> None:
    (folder / "room.fpm").write_text("Floor plan: room\n")
    result = vast_without([missing], "-V", str(document(variation)), "config", "list")
    assert result.returncode == 3
    error, hint = result.stderr.strip().splitlines()
    assert (error[:7], hint[:6]) == ("error: ", "hint: ")
    assert f"{first} needs the extra `nav` ({missing} is not installed)" in result.stderr


def test_its_types_are_described_without_it() -> None:
    packages = ["PIL", "manifold3d", "numpy", "scipy", "shapely", "textx"]
    result = vast_without(packages, "config", "variation-types")
    assert result.returncode == 0
    assert "cannot be loaded" not in result.stdout
    for name in ("PathVariationRasterized", "FloorplanVariation", "ObstacleVariation"):
        assert name in result.stdout


def test_a_check_goes_on_with_what_needs_none_of_it(folder: Path) -> None:
    (folder / "plan.vast").write_text(
        "version: 1\nexecution: {scenario_file: drive.osc, timeout: 5, resources: {cpu: some}}\n"
        "configuration:\n"
        "- {name: a, variations: [FloorplanGeneration: {name: [m], floorplans: [room.fpm]}]}\n"
        "- {name: b, variations: [PathVariationRandom: "
        "{start_pose: '@s', map_file: m, path_length: 1}]}\n"
    )
    (folder / "room.fpm").write_text("Floor plan: room\n")
    result = vast_without(["textx", "scipy"], "-V", str(folder / "plan.vast"), "config", "check")
    assert result.returncode == 2
    for words in (
        "differs from the original RoboVAST: ",
        "`some` is not a number of CPUs",
        "configuration `a`, variation `FloorplanGeneration`: FloorplanGeneration needs",
        "configuration `b`, variation `PathVariationRandom`: PathVariationRandom needs",
    ):
        assert result.stderr.count(words) >= 1, result.stderr
