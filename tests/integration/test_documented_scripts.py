"""The script on docs/how-to/scripting.md runs from its first line to its last."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from support.pages import ROOT, code_blocks


def test_the_page_of_scripts_runs_as_it_stands_there(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "configs/examples/growth_sim", tmp_path, dirs_exist_ok=True)
    blocks = code_blocks("docs/how-to/scripting.md", "python")
    assert len(blocks) == 3
    (tmp_path / "script.py").write_text("\n".join(blocks), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONWARNINGS": "error"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    told = done.stdout.splitlines()
    assert told[0] == "sweep-1-1 {'initial_population': 10, 'growth_rate': 0.05}"
    assert any(line.startswith("fixed 0 passed ") for line in told)
    assert "['job', 'population.csv', 'run.json', 'test.xml']" in told
    assert told[-1].startswith("['config', 'avg(duration)'] [('fixed', ")
