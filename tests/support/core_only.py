"""A Python with the core's packages alone: no extra is installed."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

ROOT = Path(__file__).parents[2]
_CORE = re.compile(r"^([\w.-]+)==", re.MULTILINE)


def core_site(folder: Path) -> Path:
    """Fill a folder of packages with what `pip install robovast` installs: the locked core."""
    folder.mkdir()
    for source in ("src", "cli"):
        for package in (ROOT / source).iterdir():
            if package.is_dir():
                (folder / package.name).symlink_to(package)
    names = _CORE.findall((ROOT / "requirements/run.txt").read_text())
    for name in [*(name for name in names if name != "colorama"), "robovast"]:  # Windows only
        for file in distribution(name).files or ():
            top = file.parts[0]
            if top not in ("..", "__pycache__") and not (folder / top).exists():
                (folder / top).symlink_to(
                    Path(str(file.locate())).parents[len(file.parts) - 1] / top
                )
    return folder


def vast_with_core(site: Path, *arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run `vast` with the packages of a folder alone."""
    program = (
        f"import sys; sys.path.append({str(site)!r}); from robovast_cli.entry import main; main()"
    )
    return subprocess.run(
        [sys.executable, "-S", "-I", "-c", program, *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
