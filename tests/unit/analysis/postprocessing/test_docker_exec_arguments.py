"""docker_exec.sh says what is wrong with its arguments before it looks for an engine."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from robovast.analysis.postprocessing.worker import TOOLS


def call(folder: Path, *arguments: str, **variables: str) -> tuple[int, str]:
    done = subprocess.run(
        [str(TOOLS / "docker_exec.sh"), *arguments],
        cwd=folder,
        env={"PATH": os.environ["PATH"], **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--help"], 0, "[--compat-version N] [--provenance-file HOST_PATH] SCRIPT [ARG…] FOLDER"),
        ([], 2, "SCRIPT and FOLDER are needed"),
        (["convert.py"], 2, "SCRIPT and FOLDER are needed"),
        (["--strange", "convert.py", "."], 2, "unknown option --strange"),
        (["convert.py", "--text", "none"], 2, "none: there is no such folder"),
        (["none.py", "."], 2, "none.py: there is no such script"),
        (["--compat-version", "2", "convert.py", "--text", "hi", "."], 3, "no container image is"),
        (["config_only.py", "."], 3, "no container image is named"),
    ],
)
def test_arguments(tmp_path: Path, arguments: list[str], code: int, said: str) -> None:
    (tmp_path / "convert.py").write_text("")
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "config_only.py").write_text("")
    found = call(tmp_path, *arguments, CONFIG_DIR=str(tmp_path / "config"))
    assert found[0] == code, found[1]
    assert said in found[1]
