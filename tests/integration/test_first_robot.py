"""docs/tutorials/first-robot.md does what it says, from a copy of the repository."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from robovast_testbed import cache
from support.pages import ROOT, code_blocks

PAGE = "docs/tutorials/first-robot.md"
NEEDED = ("configs/examples/robot_navigation", "container/slim", "requirements", "scripts", "src")


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A clone in which `scripts/setup robot` is done, by the environment of the tests."""
    for name in NEEDED:
        ignored = shutil.ignore_patterns("__pycache__", "assets")
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / ".venv").mkdir()
    (tmp_path / ".venv/bin").symlink_to(Path(sys.executable).parent)
    wanted = ("requirements/robot.txt", "requirements/build.txt", "pyproject.toml")
    digest = hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in wanted))
    (tmp_path / ".venv/.robovast-robot").write_text(f"{digest.hexdigest()}  -\n")
    return tmp_path


def environment() -> dict[str, str]:
    own = {"PYTHON": sys.executable, "XDG_CACHE_HOME": str(cache.root()), "BROWSER": "true"}
    return {**os.environ, **own}


def told_until_open(command: str, clone: Path, last: str = "") -> list[str]:
    """What a command says until its page answers, and then says `last`; then the page is ended."""
    with subprocess.Popen(
        ["bash", "-euc", command],
        cwd=clone,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        said, address = [], None
        while not address and (line := process.stdout.readline()):
            said.append(line)
            address = re.search(r"http://\S+", line)
        assert address, "".join(said)
        with urllib.request.urlopen(address[0], timeout=180) as answer:  # noqa: S310 - of http
            assert answer.status == 200
        while last not in said[-1] and (line := process.stdout.readline()):
            said.append(line)
        os.killpg(process.pid, signal.SIGINT)
    return said


def test_the_walk_through_works_as_it_stands_there(clone: Path) -> None:
    first, *others = code_blocks(PAGE, "bash")
    said = told_until_open(f"{first.strip()} -c 'drive-2-1-2-?'", clone, "2 processed")
    assert any("2 runs: 2 failed" in line for line in said), "".join(said)
    lines = "".join(others).splitlines(keepends=True)
    (shown,) = [line for line in lines if line.startswith("vast view")]
    lines.remove(shown)
    done = subprocess.run(
        ["bash", "-euc", "".join(lines)],
        cwd=clone,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    told_last = ("depot-1-2-1", "traffic ready")
    for told in ("no way to the goal", "collision", "plans/flat.fpm", "flat-1-1-2-2-2", *told_last):
        assert told in done.stdout
    assert told_until_open(f". .venv/bin/activate\n{shown.strip()}", clone)


@pytest.mark.parametrize(("option", "code"), [("--help", 0), ("--ros", 2)])
def test_the_script_says_how_it_is_called(option: str, code: int) -> None:
    done = subprocess.run(
        [ROOT / "scripts" / "example", option], capture_output=True, text=True, check=False
    )
    assert done.returncode == code
    assert "scripts/example --ros NAME [OPTION...]" in done.stdout + done.stderr
