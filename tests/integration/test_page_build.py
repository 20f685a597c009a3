"""The committed page is what its sources give; its own tests pass."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "web"


@pytest.mark.skipif(shutil.which("npm") is None, reason="only Node can build the page")
def test_the_committed_page_is_up_to_date() -> None:
    result = subprocess.run([SCRIPT, "--check"], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
