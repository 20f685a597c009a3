"""Which versions of the API there are, and which version of RoboVAST serves them."""

from __future__ import annotations

from pathlib import Path

from robovast.kubeapi.resources import API_VERSION

ROOT = Path(__file__).parents[3]
CHART = ROOT / "helm/robovast"


def test_manifests_of_the_pages_and_of_the_notes_have_the_version_that_is_served() -> None:
    pages = [*(ROOT / "docs").rglob("*.md"), CHART / "templates/NOTES.txt"]
    lines = [line for page in pages for line in page.read_text().splitlines()]
    stated = {line.strip() for line in lines if line.strip().startswith("apiVersion: robovast.io/")}
    assert stated == {f"apiVersion: {API_VERSION}"}
