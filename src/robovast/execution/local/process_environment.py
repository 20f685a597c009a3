"""The Python environment that executes scenarios without a container.

scenario-execution pins versions that conflict with ours, so it has its own environment, created
once from hashed requirements in the user's cache folder.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from robovast.base.errors import CannotRunError
from robovast.base.locks import lock_file
from robovast.common.execution import COMPAT_VERSION

REQUIREMENTS = Path(__file__).with_name("process_requirements.txt")
VARIABLE = "ROBOVAST_PROCESS_ENV"
"""Variable with the path of an existing environment (with `bin/scenario_execution`) to use."""

IMAGE = "process:"
"""Begins what is recorded in place of an image; the environment's name follows."""

VERSION_FILE = Path("etc") / "robovast_compat_version"


def process_environment(message: Callable[[str], None], chosen: Path | None = None) -> Path:
    """Folder of the environment, which is created if necessary.

    Args:
        message: receives progress messages.
        chosen: an existing environment, in place of the usual one.

    Raises:
        CannotRunError: it cannot be created, or the user's environment is not usable.
    """
    own = os.environ.get(VARIABLE) if chosen is None else chosen
    if own:
        return _checked(Path(own).absolute())
    folder = cache_folder() / usual_name()
    if not (folder / VERSION_FILE).is_file():
        with _locked(folder):
            if not (folder / VERSION_FILE).is_file():
                message(f"Creating the environment for local processes in {folder} (once) …")
                _make(folder)
    return folder


def existing_environment() -> Path | None:
    """Folder of the existing environment, the user's or ours, or None."""
    own = os.environ.get(VARIABLE)
    folder = Path(own) if own else cache_folder() / usual_name()
    return folder if (folder / "bin" / "scenario_execution").is_file() else None


def named_environment(name: str) -> Path | None:
    """The existing environment of a name, the user's or one in our cache; None if there is none."""
    own = os.environ.get(VARIABLE)
    folders = [Path(own)] if own else []
    if name and name == Path(name).name:
        folders.append(cache_folder() / name)
    executable = Path("bin") / "scenario_execution"
    return next((f for f in folders if f.name == name and (f / executable).is_file()), None)


def environment_as_then(recorded: str, what: str, otherwise: str) -> Path | None:
    """The environment in which plain processes were executed; None if it is the usual one.

    Args:
        recorded: what is recorded in place of an image.
        what: was executed in it.
        otherwise: how to do without it.

    Raises:
        CannotRunError: it is not here.
    """
    name = recorded.removeprefix(IMAGE)
    found = named_environment(name)
    if found is None and name not in {"", usual_name()}:
        raise CannotRunError(
            f"{what}: ran in the environment {name}, which is missing",
            hint=f"name it in {VARIABLE} (for examples with ROS: `export "
            f"{VARIABLE}=$(scripts/ros-environment)`), or {otherwise} in the current "
            "environment: `--runtime process`",
        )
    return found


def cache_folder() -> Path:
    """`$XDG_CACHE_HOME/robovast`, or `~/.cache/robovast`."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "robovast"


def _checked(folder: Path) -> Path:
    if not (folder / "bin" / "scenario_execution").is_file():
        raise CannotRunError(
            f"{VARIABLE} names {folder}, but there is no bin/scenario_execution in it",
            hint="install `scenario-execution` there, or unset the variable",
        )
    if not (folder / VERSION_FILE).is_file():
        raise CannotRunError(
            f"{VARIABLE} names {folder}, which has no image interface version",
            hint=f"create it with `mkdir -p {folder}/etc && echo {COMPAT_VERSION} > "
            f"{folder / VERSION_FILE}`",
        )
    return folder


def usual_name() -> str:
    """Name of the environment in our cache, by what is in it."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    content = REQUIREMENTS.read_bytes() + f"{version} {COMPAT_VERSION}".encode()
    return f"process-py{version}-{hashlib.sha256(content).hexdigest()[:12]}"


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    folder.parent.mkdir(parents=True, exist_ok=True)
    with folder.with_suffix(".lock").open("w") as lock:
        lock_file(lock.fileno(), folder.parent, wait=True)
        yield


def _make(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    python = folder / "bin" / "python"
    uv = shutil.which("uv")
    if uv:
        _call([uv, "venv", "--quiet", "--python", sys.executable, str(folder)], folder)
        install = [uv, "pip", "install", "--quiet", "--compile-bytecode", "--python", str(python)]
    else:
        _call([sys.executable, "-m", "venv", str(folder)], folder)
        install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    _call([*install, "--no-deps", "--require-hashes", "-r", str(REQUIREMENTS)], folder)
    version = folder / VERSION_FILE
    version.parent.mkdir(exist_ok=True)
    version.write_text(f"{COMPAT_VERSION}\n", encoding="ascii")


def _call(command: Sequence[str], folder: Path) -> None:
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        shutil.rmtree(folder, ignore_errors=True)
        last = (result.stderr or result.stdout).strip().splitlines()[-3:]
        raise CannotRunError(
            f"cannot create the environment for local processes: `{' '.join(command[:4])} …` "
            f"failed: {' / '.join(last)}",
            hint="install Python with `venv`, check the access to a package index, or name your "
            f"own environment in {VARIABLE}",
        )
