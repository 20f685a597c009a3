"""A Python with the core's packages alone: no extra is installed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterable
from importlib.metadata import distribution
from pathlib import Path

ROOT = Path(__file__).parents[2]
_CORE = re.compile(r"^([\w.-]+)==", re.MULTILINE)
_NAME = re.compile(r"[\w.-]+")


def core_site(folder: Path, *others: str) -> Path:
    """Fill a folder of packages with the locked core and others, as `pip install` does."""
    folder.mkdir()
    for source in ("src", "cli"):
        for package in (ROOT / source).iterdir():
            if package.is_dir():
                (folder / package.name).symlink_to(package)
    names = _CORE.findall((ROOT / "requirements/run.txt").read_text())
    for name in [
        *(name for name in names if name != "colorama"),
        *("robovast-operator", *_with_requirements(others)),
    ]:  # Windows only
        for file in distribution(name).files or ():
            top = file.parts[0]
            if top not in ("..", "__pycache__") and not (folder / top).exists():
                (folder / top).symlink_to(
                    Path(str(file.locate())).parents[len(file.parts) - 1] / top
                )
    return folder


def _with_requirements(names: Iterable[str]) -> set[str]:
    """Distributions and what they require, without extras."""
    found: set[str] = set()
    left = list(names)
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            listed = distribution(name).requires or ()
            left += [_NAME.match(one)[0] for one in listed if ";" not in one]  # type: ignore[index]
    return found


class CoreVast:
    """`vast` with the packages of a folder alone: each command is a fork of one process."""

    def __init__(self, site: Path, folder: Path) -> None:
        """Start the process; `folder` receives the output of commands."""
        self._output = [folder / "stdout", folder / "stderr"]
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-I", "-c", _PROGRAM, site, *self._output],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, *words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
        """Run a command for at most 120 s."""
        assert self._process.stdin
        assert self._process.stdout
        print(json.dumps([str(cwd), *map(str, words)]), file=self._process.stdin, flush=True)
        code = int(self._process.stdout.readline())
        out, err = (path.read_text() for path in self._output)
        return subprocess.CompletedProcess(words, code, out, err)

    def close(self) -> None:
        """End the process."""
        self._process.communicate(timeout=10)


_PROGRAM = """
import json, os, signal, sys
site, *output = sys.argv[1:]
sys.path.append(site)
from robovast_cli.entry import main
import robovast_cli.main
for line in sys.stdin:
    cwd, *words = json.loads(line)
    child = os.fork()
    if not child:
        signal.alarm(120)
        os.chdir(cwd)
        for number, path in enumerate([os.devnull, *output]):
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC if number else os.O_RDONLY
            os.dup2(os.open(path, flags), number)
        sys.stdin = open(os.devnull)
        sys.argv = ["vast", *words]
        main()
        sys.exit()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
