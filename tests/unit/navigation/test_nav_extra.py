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
    assert len(result.stderr.strip().splitlines()) == 1
    assert f"{first} needs the extra `nav` ({missing} is not installed)" in result.stderr


def test_its_types_are_described_without_it() -> None:
    packages = ["PIL", "manifold3d", "numpy", "scipy", "shapely", "textx"]
    result = vast_without(packages, "config", "variation-types")
    assert result.returncode == 0
    assert "cannot be loaded" not in result.stdout
    for name in ("PathVariationRasterized", "FloorplanVariation", "ObstacleVariation"):
        assert name in result.stdout
