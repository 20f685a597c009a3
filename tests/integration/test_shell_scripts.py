"""Every shell script that we ship or build with is free of the mistakes that shellcheck knows."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from robovast_testbed import debian
from robovast_testbed.pytest_plugin import skipped_when_unavailable

ROOT = Path(__file__).parents[2]
NAMES = ("audit", "example", "find-python", "lock", "pin", "ros-environment", "setup", "test")
SCRIPTS = [
    *sorted(ROOT.glob("src/robovast/execution/contract/*.sh")),
    *sorted(ROOT.glob("src/robovast/analysis/postprocessing/tools/*.sh")),
    *sorted(ROOT.glob("configs/examples/*/files/*.sh")),
    *(ROOT / "scripts" / name for name in NAMES),
    *sorted(ROOT.glob("src/robovast/agent/*.sh")),
    ROOT / "src/robovast/execution/local/run.sh.in",
    ROOT / "container/build.sh",
    ROOT / ".ci/run",
]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_shellcheck_finds_nothing(script: Path, tmp_path: Path) -> None:
    with skipped_when_unavailable():
        debian.require("shellcheck")
    if script.suffix == ".in":  # a template: what stands in it is a value
        text = re.sub(r"@[A-Z_]+@", "value", script.read_text())
        script = tmp_path / script.stem
        script.write_text(text)
    result = subprocess.run(
        ["shellcheck", "--external-sources", script], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout
