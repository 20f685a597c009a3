"""The code and every image recipe state the same compatibility version, as CI checks."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
CHECK = ROOT / "scripts" / "check_compat.py"


def check(root: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(CHECK), str(root)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_all_places_agree() -> None:
    result = check(ROOT)
    assert result.returncode == 0, result.stdout + result.stderr
    assert len(re.findall(r": 2$", result.stdout, re.MULTILINE)) == 5


def test_a_difference_is_found(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "container", tmp_path / "container")
    code = tmp_path / "src" / "robovast" / "common" / "execution.py"
    code.parent.mkdir(parents=True)
    code.write_text("COMPAT_VERSION = 3\n")
    result = check(tmp_path)
    assert result.returncode == 1
    assert "must all be equal" in result.stderr


def test_the_workflow_checks_before_it_builds() -> None:
    steps = (ROOT / ".github" / "workflows" / "image.yml").read_text()
    assert steps.index("check_compat.py") < steps.index("build.sh")
