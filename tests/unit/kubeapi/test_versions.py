"""Which versions of the API there are, and which version of RoboVAST serves them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from robovast import __version__
from robovast.kubeapi.crd import campaign_crd, configuration_crd
from robovast.kubeapi.resources import API_VERSION, NEXT_VERSION, VERSION

ROOT = Path(__file__).parents[3]
CHART = ROOT / "helm/robovast"


@pytest.mark.parametrize("definition", [campaign_crd(), configuration_crd()])
def test_both_versions_are_one_schema_and_the_older_one_is_stored(
    definition: dict[str, Any],
) -> None:
    """So no object needs a conversion, and charts that serve the older one alone find each."""
    older, newer = definition["spec"]["versions"]
    assert [v.pop("name") for v in (older, newer)] == [VERSION, NEXT_VERSION]
    assert [v.pop("storage") for v in (older, newer)] == [True, False]
    assert older == newer
    assert older["served"]
    assert "conversion" not in definition["spec"]


def test_what_programs_write_is_served_by_every_chart() -> None:
    assert API_VERSION == "robovast.io/v1alpha1"


def test_chart_package_and_images_are_of_one_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    chart = yaml.safe_load((CHART / "Chart.yaml").read_text())
    values = yaml.safe_load((CHART / "values.yaml").read_text())
    stated = {project["version"], chart["version"], chart["appVersion"]}
    assert stated == {__version__}
    images = [values[part]["image"] for part in ("operator", "agent", "example")]
    assert all(image.rpartition(":")[2].startswith(f"v{__version__}-") for image in images)


def test_manifests_of_the_pages_and_of_the_notes_have_the_version_that_stays() -> None:
    pages = [*(ROOT / "docs").rglob("*.md"), CHART / "templates/NOTES.txt"]
    lines = [line for page in pages for line in page.read_text().splitlines()]
    stated = {line.strip() for line in lines if line.strip().startswith("apiVersion: robovast.io/")}
    assert stated == {f"apiVersion: robovast.io/{NEXT_VERSION}"}
