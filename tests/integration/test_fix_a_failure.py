"""The commands of docs/tutorials/fix-a-failure.md print what the page shows."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from robovast_testbed import cache
from support.pages import ROOT, code_blocks

PAGE = "docs/tutorials/fix-a-failure.md"


def test_a_failure_is_replayed_minimised_and_mended(tmp_path: Path) -> None:
    block = next(block for block in code_blocks(PAGE, "bash") if "ros-environment" in block)
    for folder in ("scripts/", "configs/"):
        block = block.replace(folder, f"{ROOT}/{folder}")
    own = {"PYTHON": sys.executable, "XDG_CACHE_HOME": str(cache.root())}
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euc", block],
        cwd=tmp_path,
        env={**os.environ, **own, "PATH": path},
        capture_output=True,
        text=True,
    )
    said = done.stdout
    assert done.returncode == 0, said + done.stderr
    assert "100 % of the runs were unsuccessful (95 % interval 68 – 100 %)" in said
    assert "flat-1-1-2-1-1/0 (seed 671464248): same verdict (failed), same outcome.csv." in said
    assert "obstacles  1 of 1 items        0 items\nmargin     0.05          0.02  0.05\n" in said
    gate = next(block for block in code_blocks(PAGE, "text") if "better" in block)
    assert gate in said
