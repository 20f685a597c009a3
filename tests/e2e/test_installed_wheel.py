"""The built wheel in a fresh environment: what messages tell users to type works there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from robovast.base.optional_deps import EXTRAS

ROOT = Path(__file__).parents[2]
PROGRAM = """
import sys
from robovast.base.errors import CannotRunError
from robovast.base.optional_deps import EXTRAS
try:
    next(extra for extra in EXTRAS if extra.name == sys.argv[1]).require("This command")
except CannotRunError as error:
    sys.exit(str(error))
"""
"""Checks for an extra as commands do."""
TYPED = {"gui", "query"}
"""Extras that are installed; of the others, pip finds the packages: that takes half the time."""
TOO_LARGE = "rerun"
"""790 MB."""


def locked(folder: Path) -> Path:
    """The versions of the lock, as constraints without hashes."""
    names = re.findall(r"^[\w.-]+==[^\\\n]+", (ROOT / "requirements/dev.txt").read_text(), re.M)
    (folder / "versions.txt").write_text("\n".join(names))
    return folder / "versions.txt"


def test_commands_of_messages_install_their_extras(tmp_path: Path) -> None:
    wheels, place = tmp_path / "wheels", tmp_path / "env"
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*build, "--wheel-dir", wheels, ROOT], check=True, timeout=120)
    subprocess.run([sys.executable, "-m", "venv", place], check=True, timeout=120)
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith("PYTHON")},
        "PATH": f"{place / 'bin'}:{os.environ['PATH']}",
        "PIP_CONSTRAINT": str(locked(tmp_path)),
        "PIP_NO_COMPILE": "1",
        "PIP_QUIET": "1",
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
    }

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            list(map(str, words)),
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
        )

    (wheel,) = wheels.glob("robovast_operator-*.whl")
    assert run("pip", "install", wheel).returncode == 0
    assert run("vast", "--version").stderr == ""
    others = []
    for extra in EXTRAS:
        before = run("python", "-c", PROGRAM, extra.name)
        if before.returncode == 0:  # others brought its packages
            continue
        command = before.stderr.strip().rpartition("Run ")[2].strip("`.")
        assert command == f"pip install '{wheel}[{extra.name}]'"
        if extra.name not in TYPED:
            others.append(extra.name)
            continue
        installed = run("bash", "-c", command)
        assert installed.returncode == 0, installed.stderr
        assert run("python", "-c", PROGRAM, extra.name).returncode == 0
    others.remove(TOO_LARGE)
    found = run("pip", "install", "--dry-run", f"{wheel}[{','.join(others)}]")
    assert found.returncode == 0, found.stderr
    assert run("pip", "check").returncode == 0


def test_the_other_project_is_named_by_every_command(tmp_path: Path) -> None:
    (tmp_path / "robovast-2.2.1.dist-info").mkdir()
    program = (
        "import sys, sysconfig\n"
        "sysconfig.get_path = lambda name: sys.argv.pop()\n"
        "from robovast_cli.entry import main\n"
        "main()\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", program, "--version", tmp_path],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert result.returncode == 0
    assert result.stderr.startswith("warning: the package `robovast` 2.2.1 of another project")
    assert result.stdout.startswith("vast ")
