"""Generated files in the repository are those that the models make."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]
GENERATED = runpy.run_path(str(ROOT / "scripts" / "generate"))["GENERATED"]


@pytest.mark.parametrize("name", GENERATED)
def test_file_is_not_stale(name: str) -> None:
    current = (ROOT / name).read_text(encoding="utf-8")
    assert current == GENERATED[name](), f"run scripts/generate: {name} is stale"
