"""Restricts what a job's processes see of this machine.

They see the machine read-only, `/config` and `/out` of the run contract and a private `/tmp`, in
their own mount and process namespaces. `/run` is empty, since sockets there (Docker's, systemd's)
would give access to the machine. The options are those of bubblewrap; isolate.py understands them.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from robovast.execution.contract import CONFIG, OUT

_START_ISOLATE = f"""
import sys
sys.path.append({str(Path(__file__).parent)!r})
import isolate  # in place of the script itself, which Python would compile each time
isolate.main()
"""

_OWN = frozenset({"proc", "dev", "tmp", "run", "config", "out"})
"""Top-level folders that are replaced."""
_HIDDEN = ("/tmp/", "/run/")  # noqa: S108  # what is in them is hidden from runs
_SETTINGS = ("sys", "sysrq-trigger", "irq", "bus", "fs")
"""Files of /proc by which root could change the machine."""
_GRAPHICS = re.compile(r"dri|nvidia.*|nvhost.*|nvmap|kfd|dxg|mali\d*")
_CAPABILITIES = (
    "CHOWN", "DAC_OVERRIDE", "FOWNER", "FSETID", "KILL", "SETGID", "SETUID", "NET_BIND_SERVICE",
    "NET_RAW",
)  # fmt: skip
"""Capabilities of root over files and processes, as in containers; other users have none."""


_Launcher = Callable[[Path], Sequence[str]]


@dataclass(frozen=True)
class Sandbox:
    """A way to start programs in their own namespaces that works on this machine."""

    launcher: _Launcher
    """Prefix of the command line, given an empty folder."""
    shown: Sequence[Path]
    """Parts of hidden folders that programs see nevertheless."""

    def command(self, work: Path, mounts: Mapping[str, Path], program: Sequence[str]) -> list[str]:
        """The command line that starts a program.

        Args:
            work: folder to create for internal use: an empty root, and the program's `/tmp`.
            mounts: folders by their paths in the sandbox; all but `/config` are writable.
            program: the program's command line.
        """
        root, temporary = work / "root", work / "tmp"
        for folder in (root, temporary):
            folder.mkdir(parents=True, exist_ok=True)
        options = [
            *_machine(),
            *_bind("--bind", {"/tmp": temporary}),  # noqa: S108
            *_bind("--ro-bind", {str(path): path for path in self.shown}),
        ]
        for place, folder in mounts.items():
            options += _bind("--ro-bind" if place == CONFIG else "--bind", {place: folder})
        options += ["--remount-ro", "/", "--chdir", OUT, "--cap-drop", "ALL"]
        if os.getuid() == 0:
            options += [word for name in _CAPABILITIES for word in ("--cap-add", f"CAP_{name}")]
        return [*self.launcher(root), *options, "--", *program]


def find_sandbox(needed: Iterable[Path]) -> Sandbox | str:
    """A sandbox that works on this machine, or the reason why there is none.

    Args:
        needed: paths that programs must see.
    """
    faults = []
    shown = _hidden([*needed, Path("/etc/resolv.conf").resolve().parent])
    launchers = LAUNCHERS.items() if os.getuid() == 0 else reversed(LAUNCHERS.items())
    for program, launcher in launchers:
        fault = f"{program} is not installed"
        if shutil.which(program):
            sandbox = Sandbox(launcher, shown)
            fault = _try(sandbox)
            if not fault:
                return sandbox
        faults.append(fault)
    return "; ".join(faults)


def _try(sandbox: Sandbox) -> str:
    """Start a program that does nothing; return the error, or an empty text."""
    with TemporaryDirectory(prefix="robovast-") as folder:
        places = {CONFIG: Path(folder), OUT: Path(folder)}
        command = sandbox.command(Path(folder), places, ["true"])
        result = subprocess.run(command, capture_output=True, text=True, check=False)
    if not result.returncode:
        return ""
    return (result.stderr.strip().splitlines() or [f"{command[0]} ended with an error"])[-1]


def _bubblewrap(root: Path) -> Sequence[str]:
    del root
    alone = () if os.getuid() else ("unshare", "--mount")
    return *alone, "bwrap", "--unshare-pid", "--unshare-ipc", "--die-with-parent", "--as-pid-1"


def _unshare(root: Path) -> Sequence[str]:
    user, group = os.getuid(), os.getgid()
    own_rights = ("--user", f"--map-user={user}", f"--map-group={group}", "--keep-caps")
    return (
        *("setpriv", "--pdeathsig", "KILL"),
        *("unshare", "--mount", "--pid", "--ipc", "--fork", "--kill-child"),
        *(own_rights if user else ()),
        *(sys.executable, "-I", "-S", "-c", _START_ISOLATE, str(root)),
    )


LAUNCHERS: dict[str, _Launcher] = {"bwrap": _bubblewrap, "unshare": _unshare}
"""Sandboxes in the order in which root tries them; other users try the reverse.

Bubblewrap starts faster, but lets a job write to file systems mounted later, unless it is itself
in a mount namespace without propagation, which only root can create.
"""


def _machine() -> Iterator[str]:
    for name in sorted(set(os.listdir("/")) - _OWN):
        path = f"/{name}"
        if os.path.islink(path):
            yield from ("--symlink", os.readlink(path), path)
        else:
            yield from ("--ro-bind", path, path)
    yield from ("--proc", "/proc", "--dev", "/dev", "--tmpfs", "/run")
    settings = (f"/proc/{name}" for name in _SETTINGS)
    yield from _bind("--ro-bind", {path: Path(path) for path in settings if os.path.exists(path)})
    for name in filter(_GRAPHICS.fullmatch, os.listdir("/dev")):
        yield from ("--dev-bind", f"/dev/{name}", f"/dev/{name}")


def _hidden(needed: Iterable[Path]) -> list[Path]:
    """Those of the needed paths that are in hidden folders."""
    places = {place for path in needed for place in (path.absolute(), path.resolve())}
    return sorted(place for place in places if str(place).startswith(_HIDDEN) and place.exists())


def _bind(option: str, places: Mapping[str, Path]) -> Iterator[str]:
    for place, source in places.items():
        yield from (option, str(source), place)
