"""Names of packages and images that texts, messages, chart and gates print: ours, or known ones."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[3]
PIP = re.compile(r"pip install (?:-\S+ )*['\"]?([A-Za-z][\w-]*)")
IMAGE = re.compile(r"\b(?:ghcr|docker|quay)\.io/[\w./-]+")
OURS = {"robovast-operator"}
OTHERS = {"jupyterlab"}
"""Packages of others that are recommended beside RoboVAST."""
IMAGES = {
    *("ghcr.io/robovast/robovast", "ghcr.io/robovast/charts/robovast"),
    "docker.io/versity/versitygw",
    *("ghcr.io/acme", "ghcr.io/acme/", "ghcr.io/acme/runs"),  # made up, in examples
}


def texts() -> list[str]:
    patterns = ("*.py", "*.md", "*.txt", "*.yaml", "*.yml", "*.tsx", "*.ts", "*.tpl", "*Dockerfile")
    words = ["git", "ls-files", "-z", "--", *patterns, ":!tests"]
    found = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    return [(ROOT / name).read_text() for name in found.stdout.split("\0") if name]


def test_installed_packages_are_ours_or_known() -> None:
    found = {name for text in texts() for name in PIP.findall(text)}
    assert found - OTHERS == OURS


def test_images_are_ours_or_known() -> None:
    found = {name for text in texts() for name in IMAGE.findall(text)}
    assert found == IMAGES
