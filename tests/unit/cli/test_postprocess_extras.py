"""Without an extra, the commands that need it fail, and all others are executed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HIDE = """\
from importlib.machinery import PathFinder
real = PathFinder.find_spec
PathFinder.find_spec = staticmethod(
    lambda name, *more: None if name.partition(".")[0] in {hidden} else real(name, *more)
)
"""
DOCUMENT = """\
version: 1
results_processing:
  postprocessing:
  - rosbags_process: {plugins: [{type: tf_to_csv, frames: [base_link]}]}
  - rosbags_to_webm: {topic: /camera}
  - needs.py:pandas_table
  - plain.py:plain
"""
FAILED = {
    "rosbags": ["rosbags_tf_to_csv", "rosbags_to_webm"],
    "av": ["rosbags_to_webm"],
    "pandas": ["pandas_table"],
    "duckdb": [],
}


@pytest.mark.parametrize("hidden", [{"av"}, set(FAILED)], ids=["one", "all"])
def test_a_missing_extra_stops_only_its_commands(tmp_path: Path, hidden: set[str]) -> None:
    campaign = tmp_path / "results" / "demo"
    config, run = campaign / "_config", campaign / "hall" / "0"
    for folder in (config, run):
        folder.mkdir(parents=True)
    (run / "test.xml").write_text('<testsuite><testcase name="a"/></testsuite>')
    (config / "a.vast").write_text(DOCUMENT)
    plugin = "def {}(results_dir, config_dir):\n    return True, ''\n"
    (config / "needs.py").write_text("import pandas\n" + plugin.format("pandas_table"))
    wrote = "    open(results_dir + '/plain.txt', 'w').close()\n"
    (config / "plain.py").write_text(plugin.format("plain").replace("    r", f"{wrote}    r"))
    (tmp_path / "sitecustomize.py").write_text(HIDE.format(hidden=hidden))
    done = subprocess.run(
        [sys.executable, "-m", "robovast_cli", "results", "postprocess", "-r", campaign.parent],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    failed = {name for package in hidden for name in FAILED[package]}
    lines = [line for line in done.stderr.splitlines() if line.startswith("failed: ")]
    assert {line.split(": ")[2] for line in lines} == failed, done.stderr
    assert len(lines) == len(failed)
    assert all("needs the extra `" in line for line in lines)
    assert (campaign / "plain.txt").is_file()
    assert (campaign / "_execution" / "data.db").is_file()
