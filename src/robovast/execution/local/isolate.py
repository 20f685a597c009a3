"""Restrict this process's view of the machine, then execute a program.

    unshare --mount --pid --fork … python3 … ROOT [OPTION]... -- PROGRAM [ARGUMENT]...

Replaces bubblewrap within namespaces that `unshare` has just created: it understands the options
of `bwrap` (see its manual page) that sandbox.py writes. ROOT is an empty folder. It starts with
every job, so it imports little.
"""

from __future__ import annotations

import ctypes
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    Option = tuple[int, Callable[..., object]]

MS_NOSUID, MS_NODEV, MS_NOEXEC, MS_BIND, MS_REC = 0x2, 0x4, 0x8, 0x1000, 0x4000
MNT_DETACH = 0x2
READ_ONLY, NO_SUID, NO_DEVICES = 0x1, 0x2, 0x4
"""Attributes of `mount_setattr`."""
SYS_MOUNT_SETATTR, AT_FDCWD, AT_RECURSIVE = 442, -100, 0x8000
CAPABILITIES = {
    "CAP_CHOWN": 0,
    "CAP_DAC_OVERRIDE": 1,
    "CAP_FOWNER": 3,
    "CAP_FSETID": 4,
    "CAP_KILL": 5,
    "CAP_SETGID": 6,
    "CAP_SETUID": 7,
    "CAP_NET_BIND_SERVICE": 10,
    "CAP_NET_RAW": 13,
}
PR_CAPBSET_DROP, PR_SET_NO_NEW_PRIVS, PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL = 24, 38, 47, 4
CAPABILITY_VERSION = 0x20080522
DEVICES = ("null", "zero", "full", "random", "urandom", "tty")

libc = ctypes.CDLL(None, use_errno=True)


class FileSystemView:
    """The program's file system, built below a folder."""

    def __init__(self, root: str) -> None:
        """Begin with an empty one."""
        self._root = root
        self.kept: list[int] = []
        self.folder = "/"
        mount("tmpfs", root, "tmpfs", MS_NOSUID | MS_NODEV, "mode=0755")
        read_only = READ_ONLY | NO_SUID | NO_DEVICES
        self.options: dict[str, Option] = {
            "--ro-bind": (2, lambda source, path: self.bind(source, path, read_only)),
            "--bind": (2, lambda source, path: self.bind(source, path, NO_SUID | NO_DEVICES)),
            "--dev-bind": (2, lambda source, path: self.bind(source, path, NO_SUID)),
            "--symlink": (2, self.link),
            "--tmpfs": (1, self.make_temporary),
            "--proc": (1, self.make_proc),
            "--dev": (1, self.make_dev),
            "--remount-ro": (1, self.close),
            "--chdir": (1, self.choose_folder),
            "--cap-drop": (1, lambda _: None),  # all others are dropped anyway
            "--cap-add": (1, lambda name: self.kept.append(CAPABILITIES[name])),
        }

    def bind(self, source: str, path: str, attributes: int) -> None:
        """Bind-mount a file or folder, including mounts below it."""
        target = self._root + path
        if os.path.isdir(source):
            os.makedirs(target, exist_ok=True)
        elif not os.path.exists(target):
            os.makedirs(os.path.dirname(target), exist_ok=True)
            os.close(os.open(target, os.O_CREAT | os.O_WRONLY))
        mount(source, target, "", MS_BIND | MS_REC)
        restrict(target, attributes, AT_RECURSIVE)

    def link(self, content: str, path: str) -> None:
        """Create a symbolic link."""
        os.symlink(content, self._root + path)

    def make_temporary(self, path: str) -> None:
        """Create an empty folder that disappears with the last process."""
        os.makedirs(self._root + path, exist_ok=True)
        mount("tmpfs", self._root + path, "tmpfs", MS_NOSUID | MS_NODEV, "mode=0755")

    def make_proc(self, path: str) -> None:
        """Mount the processes of this namespace."""
        target = self._root + path
        os.makedirs(target)
        mount("proc", target, "proc", MS_NOSUID | MS_NODEV | MS_NOEXEC)

    def make_dev(self, path: str) -> None:
        """Create the usual devices, terminals and shared memory."""
        self.make_temporary(path)
        for name in DEVICES:
            self.bind(f"/dev/{name}", f"{path}/{name}", NO_SUID)
        for name, content in {"fd": "", "stdin": "/0", "stdout": "/1", "stderr": "/2"}.items():
            self.link(f"/proc/self/fd{content}", f"{path}/{name}")
        os.mkdir(f"{self._root}{path}/shm")
        os.mkdir(f"{self._root}{path}/pts")
        terminals = "newinstance,ptmxmode=0666,mode=620"
        mount("devpts", f"{self._root}{path}/pts", "devpts", MS_NOSUID | MS_NOEXEC, terminals)
        self.link("pts/ptmx", f"{path}/ptmx")

    def close(self, path: str) -> None:
        """Make a folder itself read-only."""
        restrict(self._root + path, READ_ONLY)

    def choose_folder(self, path: str) -> None:
        """Set the program's working directory."""
        self.folder = path

    def enter(self) -> None:
        """Make it the root; the previous root becomes unreachable."""
        os.chdir(self._root)
        checked(libc.pivot_root(b".", b"."), "pivot_root")
        checked(libc.umount2(b".", MNT_DETACH), "umount")
        os.chdir(self.folder)


def checked(result: int, what: str) -> None:
    """Raise the kernel's error, if any."""
    if result:
        raise OSError(ctypes.get_errno(), f"{what}: {os.strerror(ctypes.get_errno())}")


def mount(source: str, target: str, kind: str, flags: int, data: str = "") -> None:
    """Mount something."""
    where = (os.fsencode(source), os.fsencode(target))
    result = libc.mount(*where, kind.encode(), ctypes.c_ulong(flags), data.encode())
    checked(result, f"mount {source} on {target}")


def restrict(target: str, attributes: int, extent: int = 0) -> None:
    """Restrict a mount; with AT_RECURSIVE, also the mounts below it."""
    wanted = (ctypes.c_uint64 * 4)(attributes, 0, 0, 0)
    call = (AT_FDCWD, os.fsencode(target), extent, wanted, ctypes.c_size_t(32))
    checked(libc.syscall(SYS_MOUNT_SETATTR, *call), f"restrict {target}")


def drop_capabilities(kept: list[int]) -> None:
    """Drop all capabilities of root but these, permanently."""
    libc.prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0)
    for number in range(64):
        if number not in kept:
            libc.prctl(PR_CAPBSET_DROP, number, 0, 0, 0)  # fails for numbers beyond the last one
    mask = sum(1 << number for number in kept)
    header = (ctypes.c_uint32 * 2)(CAPABILITY_VERSION, 0)
    data = (ctypes.c_uint32 * 6)(mask, mask, 0, 0, 0, 0)
    checked(libc.capset(header, data), "capset")
    checked(libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0), "no_new_privs")


def main() -> None:
    """Build the view, enter it, execute the program."""
    words: Iterator[str] = iter(sys.argv[2:])
    try:
        view = FileSystemView(sys.argv[1])
        for option in iter(words.__next__, "--"):
            count, function = view.options[option]
            function(*(next(words) for _ in range(count)))
        view.enter()
        drop_capabilities(view.kept)
        program = list(words)
        os.execvp(program[0], program)  # noqa: S606
    except OSError as error:
        sys.exit(f"isolate: {error.strerror}")
