"""Which versions of the API there are, and which version of RoboVAST serves them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import yaml

from robovast import __version__
from robovast.kubeapi.resources import API_VERSION

ROOT = Path(__file__).parents[3]
CHART = ROOT / "helm/robovast"


def test_chart_package_and_images_are_of_one_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    chart = yaml.safe_load((CHART / "Chart.yaml").read_text())
    values = yaml.safe_load((CHART / "values.yaml").read_text())
    stated = {project["version"], chart["version"], chart["appVersion"]}
    assert stated == {__version__}
    images = [values[part]["image"] for part in ("operator", "agent", "example")]
    assert all(image.rpartition(":")[2].startswith(f"v{__version__}-") for image in images)


def test_manifests_of_the_pages_and_of_the_notes_have_the_version_that_is_served() -> None:
    pages = [*(ROOT / "docs").rglob("*.md"), CHART / "templates/NOTES.txt"]
    lines = [line for page in pages for line in page.read_text().splitlines()]
    stated = {line.strip() for line in lines if line.strip().startswith("apiVersion: robovast.io/")}
    assert stated == {f"apiVersion: {API_VERSION}"}
