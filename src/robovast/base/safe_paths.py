"""Access to files in folders that untrusted code can write: outputs of containers, stored runs,
downloads and imports.

Such folders may contain anything, and may change during access: links to files of this machine,
pipes that never end, devices, files of terabytes. So every path is opened part by part from a
trusted folder above it, its root, and below that no link is followed. Only regular files are
opened. The root itself may be reached through links.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader
from itertools import chain, count
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4

MOST = 8 << 20
"""Largest file of one run that is read into memory [bytes]; parsed data takes much more."""
MOST_OF_ALL = 1 << 30
"""Largest file whose size grows with the number of runs [bytes]."""
_PART = 1 << 16
DEEPEST = 200
"""Most levels of folders that are copied."""
MOST_HOLES = 1 << 30
"""Largest size of a file's holes, which were never written [bytes]."""

_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC
_BELOW = _FOLDER | os.O_NOFOLLOW
_READ = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
_CREATE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
_MOST_PASSES = 100_000
"""Path prefix to a folder's parent while nested folders are removed."""
_ATTEMPTS = 5
"""Attempts to create a folder while another program interferes."""


def open_file(path: Path, root: Path | None = None) -> BufferedReader:
    """Open a regular file for reading.

    Args:
        path: the file.
        root: ancestor below which no link is followed; None means the file's own folder.

    Raises:
        OSError: it is missing, or is not a regular file.
    """
    with _parent(path, root) as (folder, name):
        return os.fdopen(_open_regular(folder, name, path), "rb")


def read_at_most(file: BinaryIO, most: int) -> bytes:
    """The next bytes of a file, as many as it has, but at most `most`.

    `file.read(most)` would reserve memory for `most` bytes, however small the file is.
    """
    parts = []
    while part := file.read(min(most, _PART)):
        parts.append(part)
        most -= len(part)
    return b"".join(parts)


def read_file(path: Path, root: Path | None = None, most: int = MOST) -> bytes:
    """Read a regular file; see `open_file`.

    Raises:
        OSError: as in `open_file`, or it has more than `most` bytes.
    """
    with open_file(path, root) as file:
        fits = os.fstat(file.fileno()).st_size <= most
        content = read_at_most(file, most + 1) if fits else None
    if content is None or len(content) > most:
        raise OSError(errno.EFBIG, f"is larger than {most >> 20} MiB", str(path))
    return content


def read_end(path: Path, root: Path, most: int, begin: int = 0) -> tuple[bytes, int]:
    """The last bytes of a regular file, and where they end; see `open_file`.

    Args:
        path: of the file.
        root: ancestor of it that nobody else can replace.
        most: how many bytes.
        begin: offset of the first; counts only if the file has grown since.
    """
    with open_file(path, root) as file:
        size = os.fstat(file.fileno()).st_size
        begin = max(begin if begin <= size else 0, size - most)
        file.seek(begin)
        found = read_at_most(file, most)
        return found, begin + len(found)


def has_holes(file: BinaryIO) -> bool:
    """Whether a file takes less disk space than its size."""
    found = os.fstat(file.fileno())
    return found.st_blocks * 512 < found.st_size


def extents(file: BinaryIO) -> Iterator[tuple[int, int]]:
    """The ranges of a file that contain data; a sparse file of terabytes may have none."""
    size, end = os.fstat(file.fileno()).st_size, 0
    while end < size:
        try:
            begin = os.lseek(file.fileno(), end, os.SEEK_DATA)
        except OSError:  # only a hole follows
            return
        end = os.lseek(file.fileno(), begin, os.SEEK_HOLE)
        yield begin, end


def refuse_holes(file: BinaryIO) -> None:
    """Refuse a sparse file, which takes little of the disk but much of whoever reads all of it.

    Raises:
        OSError: more than `MOST_HOLES` of it were never written.
    """
    if has_holes(file):
        size = os.fstat(file.fileno()).st_size
        holes = size - sum(end - begin for begin, end in extents(file))
        if holes > MOST_HOLES:
            raise OSError(errno.EFBIG, f"{holes} of its {size} bytes were never written")


def status(path: Path, root: Path) -> os.stat_result | None:
    """Status of a path (of a link itself); None if it is missing or behind a link."""
    try:
        with _parent(path, root) as (folder, name):
            return os.stat(name, dir_fd=folder, follow_symlinks=False)
    except OSError:
        return None


def is_folder(path: Path, root: Path) -> bool:
    """Whether a path is a folder and not behind links."""
    found = status(path, root)
    return found is not None and stat.S_ISDIR(found.st_mode)


def is_file(path: Path, root: Path) -> bool:
    """Whether a path is a regular file and not behind links."""
    found = status(path, root)
    return found is not None and stat.S_ISREG(found.st_mode)


def names(path: Path, root: Path) -> list[str]:
    """Names in a folder, sorted; empty if it is not a folder or behind links."""
    try:
        with _folder(path, root) as folder:
            return sorted(os.listdir(folder))
    except OSError:
        return []


@contextmanager
def pinned(path: Path, root: Path) -> Iterator[Path]:
    """An alternative path to a folder that stays valid when folders above it are renamed.

    Raises:
        OSError: it is not a folder, or is behind links.
    """
    with _folder(path, root) as folder:
        yield Path(f"/proc/self/fd/{folder}")


def unused(path: Path, root: Path) -> Path:
    """The path, or the first unused one with suffix `.1`, `.2`, …"""
    others = (path.with_name(f"{path.name}.{number}") for number in count(1))
    return next(place for place in chain([path], others) if status(place, root) is None)


def create_file(path: Path, root: Path | None = None, buffering: int = -1) -> BinaryIO:
    """Create a file for writing, replacing anything there; see `open_file` for `root`."""
    with _parent(path, root) as (folder, name):
        _remove(folder, name)
        return os.fdopen(os.open(name, _CREATE, 0o666, dir_fd=folder), "wb", buffering)


def make_folder(path: Path, root: Path) -> None:
    """Create a folder and its parents, replacing anything else there."""
    with _folder(path, root, make=True):
        return


def remove(path: Path, root: Path) -> None:
    """Remove a file, a link or a folder of any depth; do nothing if it is missing.

    Raises:
        OSError: it belongs to another user.
    """
    with suppress(FileNotFoundError), _parent(path, root) as (folder, name):
        _remove(folder, name)


def regain(path: Path, root: Path) -> None:
    """Give the owner of a folder access to it, whatever its mode.

    Folders of other users, and anything but folders, are not changed.
    """
    with suppress(OSError), _parent(path, root) as (folder, name):
        _make_accessible(folder, name)


def remove_empty_folders(path: Path, root: Path) -> None:
    """Remove subfolders that contain only empty folders; the folder itself is kept."""
    with _folder(path, root) as folder:
        _prune(folder, DEEPEST)


def move(source: Path, source_root: Path, target: Path, target_root: Path) -> None:
    """Move a file, a link or a folder to an unused path; links stay links.

    Files that cannot be renamed (of another user, for example) are copied; anything but files,
    folders and links is dropped.

    Args:
        source: path to move.
        source_root: ancestor of the source below which no link is followed.
        target: the new path; its parents are created.
        target_root: like `source_root`, for the target.

    Raises:
        FileExistsError: the target exists.
        OSError: it cannot be moved or read.
    """
    with (
        _parent(source, source_root) as (folder, name),
        _parent(target, target_root, make=True) as (there, new),
    ):
        if _is_there(there, new):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
        _rename_or_copy(folder, name, there, new)


def copy(source: Path, source_root: Path, target: Path, target_root: Path) -> None:
    """Copy a file, a link or a folder to an unused path; see `move`."""
    with (
        _parent(source, source_root) as (folder, name),
        _parent(target, target_root, make=True) as (there, new),
    ):
        _copy(folder, name, there, new, DEEPEST)


def copy_file(source: Path, target: Path, root: Path) -> None:
    """Copy a regular file with its mode and times, replacing anything at the target.

    Args:
        source: the file; a link in its place is not followed.
        target: of the copy; its parents are created.
        root: ancestor of the target below which no link is followed.

    Raises:
        OSError: the source is not a regular file, or the target leads out of its root.
    """
    with (
        _parent(source, None) as (folder, name),
        _parent(target, root, make=True) as (there, new),
    ):
        _remove(there, new)
        _copy_file(folder, name, there, new)


def _rename_or_copy(folder: int, name: str, there: int, new: str) -> None:
    for attempt in (_rename, _rename_accessible):
        try:
            return attempt(folder, name, there, new)
        except OSError as error:
            if error.errno not in {errno.EACCES, errno.EPERM, errno.EXDEV}:
                raise
    _copy(folder, name, there, new, DEEPEST)
    with suppress(OSError):
        _remove(folder, name)
    return None


def _rename(folder: int, name: str, there: int, new: str) -> None:
    os.rename(name, new, src_dir_fd=folder, dst_dir_fd=there)


def _rename_accessible(folder: int, name: str, there: int, new: str) -> None:
    _make_accessible(folder, name)
    _rename(folder, name, there, new)


def _copy(folder: int, name: str, there: int, new: str, levels: int) -> None:
    kind = os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode
    if stat.S_ISLNK(kind):
        os.symlink(os.readlink(name, dir_fd=folder), new, dir_fd=there)
    elif stat.S_ISDIR(kind):
        if not levels:
            raise OSError(errno.ENAMETOOLONG, f"is more than {DEEPEST} folders deep", name)
        os.mkdir(new, dir_fd=there)
        with _subfolder(folder, name) as below, _subfolder(there, new) as copy:
            for child in os.listdir(below):
                _copy(below, child, copy, child, levels - 1)
    elif stat.S_ISREG(kind):
        _copy_file(folder, name, there, new)


def _copy_file(folder: int, name: str, there: int, new: str) -> None:
    with (
        os.fdopen(_open_regular(folder, name, name), "rb") as source,
        os.fdopen(os.open(new, _CREATE, 0o600, dir_fd=there), "wb") as target,
    ):
        found = os.fstat(source.fileno())
        for begin, end in extents(source):
            source.seek(begin)
            target.seek(begin)
            while begin < end and (chunk := source.read(min(end - begin, 1 << 20))):
                begin += target.write(chunk)
        target.truncate(found.st_size)
        os.fchmod(target.fileno(), stat.S_IMODE(found.st_mode) & 0o777)
        os.utime(target.fileno(), ns=(found.st_atime_ns, found.st_mtime_ns))


def _remove(folder: int, name: str) -> None:
    if not _unlinked(folder, name):
        with _subfolder(folder, name) as below:
            _empty(below)
        os.rmdir(name, dir_fd=folder)


def _unlinked(folder: int, name: str) -> bool:
    """Remove anything but a folder; return False for a folder, after making it accessible."""
    try:
        os.unlink(name, dir_fd=folder)
    except FileNotFoundError:
        return True
    except (IsADirectoryError, PermissionError):
        if not stat.S_ISDIR(os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode):
            raise
        with suppress(PermissionError):
            _make_accessible(folder, name)
        return False
    return True


def _empty(folder: int) -> None:
    """Empty a folder level by level, so that any depth is possible."""
    for _ in range(_MOST_PASSES):
        found = os.listdir(folder)
        if not found:
            return
        for name in found:
            if not _unlinked(folder, name):
                _lift(folder, name)


def _lift(folder: int, name: str) -> None:
    """Move a folder's subfolders up beside it, and remove it with its files."""
    with _subfolder(folder, name) as below:
        for child in os.listdir(below):
            if not _unlinked(below, child):
                _rename(below, child, folder, f".{uuid4().hex}")
    os.rmdir(name, dir_fd=folder)


def _prune(folder: int, levels: int) -> None:
    for name in os.listdir(folder):
        if levels and stat.S_ISDIR(os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode):
            with suppress(OSError):
                with _subfolder(folder, name) as below:
                    _prune(below, levels - 1)
                os.rmdir(name, dir_fd=folder)


def _make_accessible(folder: int, name: str) -> None:
    """Give the owner access to a folder, whose mode may prevent it."""
    handle = os.open(name, os.O_PATH | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder)
    try:
        mode = os.fstat(handle).st_mode
        if stat.S_ISDIR(mode) and mode & stat.S_IRWXU != stat.S_IRWXU:
            os.chmod(f"/proc/self/fd/{handle}", stat.S_IMODE(mode) | stat.S_IRWXU)
    finally:
        os.close(handle)


def _is_there(folder: int, name: str) -> bool:
    try:
        os.stat(name, dir_fd=folder, follow_symlinks=False)
    except FileNotFoundError:
        return False
    return True


def _open_regular(folder: int, name: str, path: Path | str) -> int:
    # Never open a device: even that may have effects.
    _check_regular(os.stat(name, dir_fd=folder, follow_symlinks=False), path)
    file = os.open(name, _READ, dir_fd=folder)
    try:
        _check_regular(os.fstat(file), path)
    except OSError:
        os.close(file)
        raise
    return file


def _check_regular(found: os.stat_result, path: Path | str) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not stat.S_ISREG(found.st_mode):
        link = stat.S_ISLNK(found.st_mode)
        why = "is a link, which is not followed" if link else "is not a regular file"
        raise OSError(errno.ELOOP if link else errno.EINVAL, why, str(path))


@contextmanager
def _parent(path: Path, root: Path | None, *, make: bool = False) -> Iterator[tuple[int, str]]:
    """The open parent folder of a path, and the last name."""
    if path.name in {"", ".."} or "\0" in path.name:
        raise OSError(errno.EINVAL, "has no name", str(path))
    with _folder(path.parent, path.parent if root is None else root, make=make) as folder:
        yield folder, path.name


@contextmanager
def _folder(path: Path, root: Path, *, make: bool = False) -> Iterator[int]:
    """Open a folder below another; with `make`, create it in place of anything else there."""
    parts = path.relative_to(root).parts if path.is_relative_to(root) else ("..",)
    if ".." in parts or "\0" in str(path):
        raise OSError(errno.EINVAL, "leads out of its folder", str(path))
    folder = os.open(root, _FOLDER)
    try:
        for part in parts:
            below = _open_or_create(folder, part) if make else os.open(part, _BELOW, dir_fd=folder)
            os.close(folder)
            folder = below
        yield folder
    finally:
        os.close(folder)


def _open_or_create(folder: int, name: str) -> int:
    for _ in range(_ATTEMPTS):
        with suppress(FileExistsError):
            os.mkdir(name, dir_fd=folder)
        try:
            return os.open(name, _BELOW, dir_fd=folder)
        except OSError as error:
            if error.errno == errno.EACCES:
                _make_accessible(folder, name)
            elif error.errno in {errno.ELOOP, errno.ENOTDIR}:
                os.unlink(name, dir_fd=folder)
            elif error.errno != errno.ENOENT:
                raise
    raise OSError(errno.EBUSY, "keeps changing", name)


@contextmanager
def _subfolder(folder: int, name: str) -> Iterator[int]:
    below = os.open(name, _BELOW, dir_fd=folder)
    try:
        yield below
    finally:
        os.close(below)
