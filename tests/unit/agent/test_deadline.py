"""Code of users that hangs in a pod ends, and it is said where it hangs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from support.patience import PATIENCE

from robovast.kubeapi.pod_contract.exit_codes import AgentExit

HANGS = """\
import time
from pathlib import Path

from robovast.agent.deadline import deadline


def ask():
    while True:
        try:
            time.sleep(60)
        except BaseException:
            pass


with deadline(SECONDS, Path("told").write_text):
    CALL
print("done")
"""


def program(folder: Path, seconds: float, call: str) -> subprocess.CompletedProcess[str]:
    (folder / "strategy.py").write_text(
        HANGS.replace("SECONDS", str(seconds)).replace("CALL", call)
    )
    command = [sys.executable, "strategy.py"]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False
    )


def test_what_hangs_is_ended_whatever_it_catches_and_its_place_is_told(tmp_path: Path) -> None:
    ended = program(tmp_path, 3, "ask()")
    assert ended.returncode == AgentExit.BAD_DOCUMENT
    assert (tmp_path / "told").read_text() == "`ask` (strategy.py:10)"
    assert "in <module>" in ended.stderr, "the log has the callers"


def test_what_is_done_in_time_goes_on(tmp_path: Path) -> None:
    ended = program(tmp_path, PATIENCE, "pass")
    assert (ended.returncode, ended.stdout) == (0, "done\n")
    assert not (tmp_path / "told").exists()
