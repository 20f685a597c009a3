"""Every path that the maps of the code name is there."""

from __future__ import annotations

import re
from pathlib import PurePosixPath

import pytest
from support.pages import ROOT

PATHS = re.compile(
    r"(?:src|operator|cli|docs|tests|scripts|configs|container|crds|helm|web)/[\w./-]*|pyproject\.toml"
)


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "docs/explanation/architecture.md"])
def test_each_path_on_a_page_exists(page: str) -> None:
    named = {path.rstrip(".") for path in PATHS.findall((ROOT / page).read_text())}
    assert named
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


def test_each_package_of_the_library_is_on_the_map() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    inside = {path.parent.name for path in (ROOT / "src/robovast").glob("*/__init__.py")}
    unnamed = {name for name in inside if f"{name}/" not in text}
    assert unnamed == {"results_processing"}  # import paths of plugins alone


def test_a_question_of_a_newcomer_is_answered_by_three_files_at_most() -> None:
    table = (ROOT / "CONTRIBUTING.md").read_text().partition("| to find |")[2]
    rows = [line for line in table.partition("\n\n")[0].splitlines() if line.startswith("| ")]
    for row in rows[1:]:
        files = re.findall(r"`([^`]+\.[a-z]+)`", row)
        assert 1 <= len({PurePosixPath(file) for file in files}) <= 3, row
