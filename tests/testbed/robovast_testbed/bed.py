"""A testbed: a folder, a network and a mount namespace and a group of cgroups of the same name.

What runs in a testbed is found by where it is, never by a remembered process id: a process
belongs to it when it lives in its network namespace or has its root file system in its folder.
So a testbed can be removed without a trace even when whoever started it has crashed.
"""

import fcntl
import os
import shutil
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from . import cache, debian, leftovers
from .commands import run
from .errors import StartFailed, Unavailable

NETNS = Path("/run/netns")
CGROUP = "robovast-testbed"
# Folders that engines insist on; each testbed sees its own ones.
PRIVATE_FOLDERS = (
    "/run/containerd",
    "/run/netns",
    "/var/lib/cni",
    "/var/lib/kubelet",
    "/var/log/containers",
    "/var/log/pods",
)


@dataclass(frozen=True)
class Bed:
    """One testbed; several run side by side under different names."""

    name: str
    daemons: "list[Daemon]" = field(default_factory=list, compare=False)

    @property
    def folder(self) -> Path:
        """Return the folder that holds all of its state; it goes when the testbed goes."""
        return _folders() / self.name

    @property
    def netns(self) -> Path:
        """Return the handle of its network namespace."""
        return NETNS / f"robovast-{self.name}"

    @property
    def cgroup(self) -> str:
        """Return the cgroup under which its containers run, in every hierarchy."""
        return f"/{CGROUP}/{self.name}"

    @property
    def inside(self) -> list[str]:
        """Return the words before a command that make it run in the namespaces."""
        # Not `ip netns exec`: it mounts a fresh /sys, which hides the cgroups.
        return ["nsenter", f"--net={self.netns}", f"--mount={_mount_handle(self)}"]

    def private(self, name: str) -> Path:
        """Return where one of the private folders is."""
        return self.folder / "private" / name.lstrip("/").replace("/", "-")

    def run(self, *command: str | Path) -> str:
        """Run a command to its end in the namespaces; return its standard output."""
        return run([*self.inside, *command])

    def spawn(
        self,
        name: str,
        command: Sequence[str | Path],
        *,
        env: Mapping[str, str] | None = None,
        pass_fds: Sequence[int] = (),
    ) -> "Daemon":
        """Start a long-running program in the namespaces, logging to `logs/NAME.log`."""
        log = self.folder / "logs" / f"{name}.log"
        log.parent.mkdir(exist_ok=True)
        with log.open("ab") as stream:
            process = subprocess.Popen(
                [*self.inside, *(str(part) for part in command)],
                # The engines are written in Go. To collect garbage less often saves CPU time.
                env=os.environ | {"GOGC": "300"} | (env or {}),
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                start_new_session=True,
                pass_fds=pass_fds,
            )
        self.daemons.append(Daemon(name, process, log))
        return self.daemons[-1]


@dataclass(frozen=True)
class Daemon:
    """A program that a testbed has started."""

    name: str
    process: "subprocess.Popen[bytes]"
    log: Path

    def failure(self) -> str | None:
        """Return why it is no longer running, or None while it runs."""
        code = self.process.poll()
        if code is None:
            return None
        tail = "\n".join(self.log.read_text(errors="replace").splitlines()[-15:])
        return f"{self.name} ended with exit code {code}\n{tail}"


@contextmanager
def session(name: str) -> Iterator[Bed]:
    """Hold a testbed for as long as the block runs; remove it afterwards.

    Testbeds whose sessions have crashed are removed first.

    :raises Unavailable: without root, or with ``ROBOVAST_TESTBED=off``.
    """
    if os.environ.get("ROBOVAST_TESTBED") == "off":
        raise Unavailable("real engines are off; `scripts/test --all` starts them")
    debian.require("ip", "nsenter")
    sweep()
    with _lock(name) as handle:
        if handle is None:
            raise StartFailed(f"testbed {name} is in use by another process")
        bed = _create(name)
        try:
            yield bed
        finally:
            destroy(bed)


@contextmanager
def keep(name: str) -> Iterator[Bed]:
    """Make a testbed that stays after the block, until `destroy`; removed when the block fails.

    :raises StartFailed: when it exists already.
    """
    debian.require("ip", "nsenter")
    sweep()
    with _lock(name, patience=5) as handle:
        if handle is None or Bed(name).folder.exists():
            raise StartFailed(f"testbed {name} is up already; `down --name {name}` removes it")
        bed = _create(name)
        try:
            yield bed
        except BaseException:
            destroy(bed)
            raise
        _kept(bed).touch()


def release(name: str) -> None:
    """Remove a kept testbed.

    :raises StartFailed: when a session owns it, or there is none of this name.
    """
    with _lock(name, patience=5) as handle:
        if handle is None:
            raise StartFailed(f"testbed {name} is in use by a running session")
        if not Bed(name).folder.exists():
            raise StartFailed(f"there is no testbed {name}; there are: {', '.join(names()) or '-'}")
        destroy(Bed(name))


def kept() -> list[str]:
    """Return the names of the testbeds that stay until they are released."""
    return [name for name in names() if _kept(Bed(name)).exists()]


def names() -> list[str]:
    """Return the names of all testbeds of this machine."""
    return sorted(folder.name for folder in _folders().iterdir())


def sweep() -> None:
    """Remove the testbeds whose session is dead."""
    for name in names():
        with _lock(name) as handle:
            if handle is not None and _is_stale(Bed(name)):
                destroy(Bed(name))


def destroy(bed: Bed) -> None:
    """End everything in the testbed and remove it."""
    leftovers.kill(bed.netns, bed.folder)
    for daemon in bed.daemons:
        daemon.process.wait()
    leftovers.unmount(bed.folder)
    if bed.netns.exists():
        run(["ip", "netns", "delete", bed.netns.name])
    leftovers.remove_cgroups(bed.cgroup)
    shutil.rmtree(bed.folder, ignore_errors=False)


def _give_cpu_to_containers() -> None:
    """Let the containers of all testbeds together have the CPU time of eight processes.

    By default their group has that of one process, and tests beside it leave little for pods.
    """
    if (hierarchy := leftovers.CGROUPS / "cpu").is_dir():
        for name in (CGROUP, "k8s.io"):
            (hierarchy / name).mkdir(exist_ok=True)
            (hierarchy / name / "cpu.shares").write_text(str(8 * 1024))


def _create(name: str) -> Bed:
    bed = Bed(name)
    if bed.folder.exists() or bed.netns.exists():
        bed.folder.mkdir(exist_ok=True)
        destroy(bed)
    bed.folder.mkdir()
    _give_cpu_to_containers()
    run(["ip", "netns", "add", bed.netns.name])
    _add_mount_namespace(bed)
    bed.run("ip", "link", "set", "lo", "up")
    return bed


def _add_mount_namespace(bed: Bed) -> None:
    handle = _mount_handle(bed)
    # A mount namespace can be pinned only below a mount that is private.
    run(["mount", "--bind", bed.folder, bed.folder])
    run(["mount", "--make-private", bed.folder])
    handle.touch()
    # As a slave it sees what the machine mounts later, and lets go what the machine unmounts.
    run(["unshare", f"--mount={handle}", "--propagation=slave", "true"])
    for name in PRIVATE_FOLDERS:
        own = bed.private(name)
        own.mkdir(parents=True)
        Path(name).mkdir(parents=True, exist_ok=True)
        bed.run("mount", "--bind", own, name)


def _mount_handle(bed: Bed) -> Path:
    return bed.folder / "mount"


def _is_stale(bed: Bed) -> bool:
    """Say whether a testbed without a session is there but not one that somebody keeps."""
    return bed.folder.exists() and not (_kept(bed).exists() and bed.netns.exists())


def _kept(bed: Bed) -> Path:
    return bed.folder / "kept"


def _folders() -> Path:
    folder = cache.root() / "beds"
    folder.mkdir(exist_ok=True)
    return folder


@contextmanager
def _lock(name: str, patience: float = 0) -> Iterator[IO[str] | None]:
    """Try for `patience` seconds to own a testbed's name: the lock, or None when it is taken."""
    deadline = time.monotonic() + patience
    with cache.lock_file(f"bed-{name}").open("w") as handle:
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() < deadline:
                    time.sleep(0.1)
                    continue
                yield None
            else:
                yield handle
            return
