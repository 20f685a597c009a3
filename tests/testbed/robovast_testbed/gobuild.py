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
    registry: str = ""
    """Go file that imports plugins, one a line, and does nothing else."""
    plugins: tuple[str, ...] = ()
    """Names of the plugins that stay in it. The build takes less time without the others."""


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
            if program.registry:
                leave_out(copy / program.registry, program.plugins)
            output, flags = folder / program.name, (QUICK, program.ldflags, program.tags)
            _compile(copy, program.package, output, *flags)

    key = "+".join((f"go/{program.name}-{program.version}", *program.plugins))
    return cache.once(key, make) / program.name


def leave_out(registry: Path, kept: tuple[str, ...]) -> None:
    """Remove the imports of all plugins but some.

    :raises Unavailable: if one of those is not imported.
    """
    lines = registry.read_text().splitlines(keepends=True)
    named = {line.rstrip('"\n').rpartition("/")[2]: line for line in lines if '"' in line}
    if missing := set(kept) - named.keys():
        raise Unavailable(f"{registry.name} imports no plugin {', '.join(sorted(missing))}")
    gone = {line for plugin, line in named.items() if plugin not in kept}
    registry.write_text("".join(line for line in lines if line not in gone))


def build_own(name: str, ldflags: str = "", tags: str = "", modfile: str = "") -> Path:
    """Return the cached executable of one of the testbed's own programs, keyed by content."""
    folder = OWN_SOURCES / name

    def make(target: Path) -> None:
        _compile(folder, ".", target / name, FAST, ldflags, tags, modfile)

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
