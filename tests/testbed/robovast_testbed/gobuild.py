"""Go programs, built from source through the machine's own Go module proxy."""

import json
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from . import cache
from .commands import run
from .errors import Unavailable

OWN_SOURCES = Path(__file__).parent.parent / "go"
COMPILER = {"CGO_ENABLED": "0", "GOGC": "400", "GOMEMLIMIT": "2GiB"}
"""Environment of the compiler. It collects garbage rarely, which takes a third less CPU time."""
FAST = "-dwarf=false"
"""Flags for programs that work all the time. They make no debugger's tables, which are not kept."""
QUICK = f"{FAST} -l"
"""Flags for all others: without inlining they are built by a quarter faster, and run slower."""


@dataclass(frozen=True)
class Program:
    """A main package of a published Go module."""

    name: str
    module: str
    version: str
    package: str = "."
    ldflags: str = ""
    tags: str = ""


def build(program: Program) -> Path:
    """Return the cached executable of a published program.

    :raises Unavailable: without Go.
    """

    def make(folder: Path) -> None:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            # As the main module, a copy may use the replace and exclude lines of its go.mod.
            copy = Path(scratch) / "module"
            shutil.copytree(source(program.module, program.version), copy)
            run(["chmod", "-R", "u+w", copy])
            output, flags = folder / program.name, (QUICK, program.ldflags, program.tags)
            _compile(copy, program.package, output, *flags)

    return cache.once(f"go/{program.name}-{program.version}", make) / program.name


def build_own(name: str, ldflags: str = "", tags: str = "", modfile: str = "") -> Path:
    """Return the cached executable of one of the testbed's own programs, keyed by content."""
    folder = OWN_SOURCES / name

    def make(target: Path) -> None:
        compiler = QUICK if modfile else FAST
        _compile(folder, ".", target / name, compiler, ldflags, tags, modfile)

    key = f"go/{name}-{cache.digest([folder], ldflags, tags, modfile)}"
    return cache.once(key, make) / name


def source(module: str, version: str) -> Path:
    """Return the read-only folder of a module's source, downloaded when missing."""
    with tempfile.TemporaryDirectory() as neutral:
        answer = run([_go(), "mod", "download", "-json", f"{module}@{version}"], cwd=Path(neutral))
    return Path(json.loads(answer)["Dir"])


def _go() -> str:
    found = shutil.which("go")
    if found is None:
        raise Unavailable("the testbed needs Go, to build the programs that it runs")
    return found


def _compile(
    folder: Path,
    package: str,
    output: Path,
    compiler: str,
    ldflags: str = "",
    tags: str = "",
    modfile: str = "",
) -> None:
    command: list[str | Path] = [
        *(_go(), "build", "-p", "2", "-trimpath", "-buildvcs=false", f"-gcflags=all={compiler}"),
        *(("-modfile", modfile) if modfile else ()),
        *("-tags", tags, "-ldflags", f"-s -w {ldflags}".strip(), "-o", output, package),
    ]
    run(command, cwd=folder, env=os.environ | COMPILER)
