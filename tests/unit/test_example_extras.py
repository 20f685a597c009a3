"""What README tells to install is enough for every example, its notebooks included."""

from __future__ import annotations

import ast
import json
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from robovast.model.document import load_document
from robovast.model.document.search.plugins import BUILT_IN, STRATEGIES

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "configs" / "examples").glob("*/*.vast"))
EXTRA_OF = {
    **dict.fromkeys(("matplotlib", "pandas"), "analysis"),
    **dict.fromkeys(("numpy", "scipy", "PIL", "shapely"), "nav"),
    **dict.fromkeys(("IPython", "nbclient"), "notebooks"),
    "duckdb": "query",
}
"""Extras by what is imported; what no extra has is in none of them."""
CORE = {"yaml", "robovast", "robovast_nav", "rdflib"}


def told() -> set[str]:
    line = re.search(r"pip install '\.\[([\w,]+)\]'", (ROOT / "README.md").read_text())
    assert line is not None
    return set(line[1].split(","))


def imported(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (name.name.partition(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield str(node.module).partition(".")[0]


def notebook_imports(folder: Path) -> set[str]:
    found: set[str] = set()
    for path in folder.glob("analysis/*.ipynb"):
        cells = json.loads(path.read_text())["cells"]
        code = (c["source"] for c in cells if c["cell_type"] == "code")
        found.update(*(imported("".join(source)) for source in code))
    modules = list(folder.glob("analysis/*.py"))
    found.update(*(imported(path.read_text()) for path in modules))
    return found - {path.stem for path in modules} - set(sys.stdlib_module_names)


def extras_of_strategy(strategy: str) -> set[str]:
    _, extra = BUILT_IN[STRATEGIES][strategy]
    return {extra.name} if extra else set()


def needed(path: Path) -> set[str]:
    vast = load_document(path).vast
    calls = [call for entry in vast.configuration or [] for call in entry.variations or []]
    if vast.search is not None:
        calls += vast.search.variations or []
    extras = {"nav" for call in calls if call.name.startswith(("Floorplan", "Obstacle", "Path"))}
    extras.update(extras_of_strategy(vast.search.strategy) if vast.search else ())
    for call in vast.postprocessing:
        extras.update({"ros"} if call.name.startswith("rosbags_") else ())
        extras.update({"video"} if call.name == "rosbags_to_webm" else ())
    return extras | ({"analysis", "gui", "notebooks"} if vast.visualization else set())


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_needs_no_more_than_readme_installs(path: Path) -> None:
    assert needed(path) <= told()
    for module in notebook_imports(path.parent) - CORE:
        assert EXTRA_OF[module] in told(), f"{module} of {path.parent.name}"


def test_the_extras_exist_and_have_what_notebooks_import() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    assert told() <= set(extras)
    assert any(requirement.startswith("matplotlib") for requirement in extras["analysis"])
