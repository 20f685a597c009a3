"""A disk whose power can be cut: what was not synced is gone, as far as the file system allows."""

from __future__ import annotations

import fcntl
import os
import shutil
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

CAN_CUT_POWER = os.getuid() == 0 and shutil.which("mkfs.ext4") is not None
WHY_NOT = "a disk of its own needs root and mkfs.ext4"

_EXT4_IOC_SHUTDOWN = 0x8004587D
_NO_LOG_FLUSH = 2
_FORGETFUL = "loop,noauto_da_alloc,commit=300"
"""Nothing is written before somebody asks for it or 30 s have passed."""


class PowerCutDisk:
    """An ext4 file system in a file."""

    def __init__(self, folder: Path, size: str) -> None:
        self._image = folder / "disk.img"
        self._starts = 0
        self.root = folder / "disk"
        self.root.mkdir()
        subprocess.run(["truncate", "-s", size, self._image], check=True)
        subprocess.run(["mkfs.ext4", "-q", self._image], check=True)
        self._mount()

    def cut(self) -> None:
        """Cut the power: from here on nothing reaches the disk, and what has not is lost."""
        descriptor = os.open(self.root, os.O_RDONLY)
        try:
            fcntl.ioctl(descriptor, _EXT4_IOC_SHUTDOWN, struct.pack("I", _NO_LOG_FLUSH))
        finally:
            os.close(descriptor)

    def restart(self) -> None:
        """Start again with a copy of what is on the disk: the dead one may still be in use."""
        self.remove()
        dead, self._image = self._image, self._image.with_suffix(f".{self._starts}")
        self._starts += 1
        subprocess.run(["cp", "--sparse=always", dead, self._image], check=True)
        dead.unlink()
        self._mount()

    def remove(self) -> None:
        """Take it away."""
        subprocess.run(["umount", "--lazy", self.root], check=True)

    def _mount(self) -> None:
        subprocess.run(["mount", "-o", _FORGETFUL, self._image, self.root], check=True)


@contextmanager
def power_cut_disk(folder: Path, size: str = "64M") -> Iterator[PowerCutDisk]:
    """A disk for tests, empty, in a folder."""
    disk = PowerCutDisk(folder, size)
    try:
        yield disk
    finally:
        disk.remove()
