"""Unpacks archives from untrusted sources; never writes outside the target folder."""

from __future__ import annotations

import errno
import lzma
import os
import shlex
import stat
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from time import mktime
from typing import IO, Any, Literal, Self

from robovast.base.errors import InputError

CHUNK = 2**20
"""Block size for copying files [byte]."""

MOST_EXPANSION = 200
"""Largest ratio of unpacked to packed size; campaigns have ratios from 2 to 30."""
LEAST_ROOM = 64 << 20
"""Unpacked size that is allowed for any archive [byte]."""
_LONGEST_TARGET = 4096
"""Longest target of a link in Linux [byte]; creating longer links fails."""
_LONGEST_HEADER = 1 << 14
"""Largest metadata of a tar entry, and of all entries together [byte]; some versions of Python take
time that grows with the square of it."""
_HEADERS = (
    tarfile.XHDTYPE,
    tarfile.XGLTYPE,
    tarfile.SOLARIS_XHDTYPE,
    tarfile.GNUTYPE_LONGNAME,
    tarfile.GNUTYPE_LONGLINK,
)
_OVERHEAD = 512
"""Disk space that is counted for every entry, even an empty one [byte]."""

_ZIP = (b"PK\3\4", b"PK\5\6")
"""How zip files begin. `zipfile.is_zipfile` also accepts a tar file that ends with a zip file."""
_ZSTD = b"\x28\xb5\x2f\xfd"
_ENCRYPTED = 1
"""Flag of an entry of a zip file."""

_DAMAGED = (
    tarfile.TarError,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    KeyError,
    NotImplementedError,  # an unknown compression
    UnicodeError,
    RuntimeError,  # an encrypted zip file
    ValueError,  # a size or an offset that no file has
    OverflowError,
    struct.error,
)
_DAMAGED_CODES = (None, errno.EINVAL)
"""Codes of OSError for content that cannot be unpacked, and for an offset that no file has."""


@dataclass(frozen=True)
class Member:
    """An entry of an archive."""

    name: str
    kind: Literal["file", "folder", "link", "copy", "other"]
    """A copy is a hard link to an earlier entry."""
    open: Callable[[], IO[bytes] | None]
    """Content of a file."""
    executable: bool = False
    modified: float = 0.0
    """Modification time [s since the epoch]."""
    target: str = ""
    """Target of a link or a copy."""


def unpack(archive: Path, folder: Path, expansion: float = MOST_EXPANSION) -> list[Path]:
    """Unpack a tar file (any compression) or a zip file into an empty folder.

    Owners and special permissions are not restored. (`tarfile` can do the same only from
    Python 3.11.4 on; Debian 12 has an older one.)

    Args:
        archive: the archive.
        folder: the empty folder.
        expansion: how many times its size an archive may unpack to.

    Returns:
        The symbolic links, which may point anywhere: check them with `refuse_links_out`.

    Raises:
        InputError: the archive is missing, damaged, or has an entry outside the folder.
        OSError: the folder cannot be written.
    """
    links: dict[Path, str] = {}
    room = _Room(archive, expansion)
    with _members(archive, room) as members:
        for entry in members:
            path = folder / _checked(archive, entry)
            room.take(_OVERHEAD)
            is_copy = entry.kind == "copy"
            member = _copy(archive, entry, folder, links) if is_copy else entry
            if member.kind == "link":
                path.parent.mkdir(parents=True, exist_ok=True)
                links[path] = member.target
            elif path != folder:
                _write(archive, member, path, room)
    # Links come last: nothing is ever written through one.
    for path, target in links.items():
        _link(archive, path, target)
    return list(links)


def refuse_links_out(archive: Path, links: Iterable[Path], folder: Path) -> None:
    """Refuse links that end outside a folder, whichever links they pass on their way.

    Raises:
        InputError: a link ends outside the folder, or nowhere.
    """
    root = folder.resolve()
    for link in links:
        try:
            end = link.resolve()
        except (OSError, RuntimeError):  # Python before 3.13 raises RuntimeError for circular links
            raise _refused(archive, link.name, "is a link that leads in a circle") from None
        if not end.is_relative_to(root):
            raise _refused(
                archive, link.name, f"is a link out of its folder, to `{link.readlink()}`"
            )


def _checked(archive: Path, member: Member) -> PurePosixPath:
    if member.kind == "other":
        raise _refused(archive, member.name, "is neither a file, a folder nor a link")
    return _inside(archive, member.name)


def _inside(archive: Path, name: str) -> PurePosixPath:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\0" in name:
        raise _refused(archive, name, "is outside of its folder")
    return path


def _copy(archive: Path, member: Member, folder: Path, links: Mapping[Path, str]) -> Member:
    """The file or link that a hard link stands for; `tarfile` would keep all entries for it."""
    original = folder / _inside(archive, member.target)
    if original in links:
        return replace(member, kind="link", target=links[original])
    if not os.path.isfile(original):
        raise _refused(archive, member.name, "is a hard link, but not to an earlier file")
    return replace(member, kind="file", open=lambda: original.open("rb"))


def _entry_type(room: _Room) -> type[tarfile.TarInfo]:
    """Tar entries whose metadata is limited, and takes its part of the space."""

    class ArchiveEntry(tarfile.TarInfo):
        shared = 0
        """Size of the metadata of all entries together, which `tarfile` copies to each [byte]."""

        @classmethod
        def frombuf(cls, buf: bytes | bytearray, encoding: Any, errors: str) -> Self:
            """Read a header; see `tarfile.TarInfo`."""
            entry = super().frombuf(buf, encoding, errors)
            header = entry.size if entry.type in _HEADERS else 0
            ArchiveEntry.shared += header if entry.type == tarfile.XGLTYPE else 0
            if entry.size < 0 or max(header, ArchiveEntry.shared) > _LONGEST_HEADER:
                raise tarfile.ReadError(f"a header of {entry.size} bytes")
            room.take(header)
            return entry

    return ArchiveEntry


class _Room:
    """The space that an archive may still take when unpacked, as a limit for archive bombs."""

    def __init__(self, archive: Path, expansion: float) -> None:
        self._archive = archive
        self._expansion = expansion
        self._most = max(LEAST_ROOM, expansion * _size(archive))
        self._left = self._most

    def take(self, size: int) -> None:
        """Use some of the space.

        Raises:
            InputError: not enough space is left.
        """
        self._left -= size
        if self._left < 0:
            most = f"{self._most / 2**20:.0f} MiB, {self._expansion:g} times its size"
            raise InputError(
                f"{self._archive}: rejected, because it unpacks to more than {most}. A malicious "
                "archive can fill the disk. Nothing was imported",
                hint="if you trust it, unpack it with `tar` or `unzip` into the results folder",
            )


def _size(archive: Path) -> int:
    try:
        return archive.stat().st_size
    except OSError:  # reported when the archive is opened
        return 0


def _write(archive: Path, member: Member, path: Path, room: _Room) -> None:
    try:
        if member.kind == "folder":
            path.mkdir(parents=True, exist_ok=True)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            content = member.open()
            if content is not None:
                with content:
                    while chunk := content.read(CHUNK):
                        room.take(len(chunk))
                        file.write(chunk)
    except (FileExistsError, NotADirectoryError):
        raise _refused(archive, member.name, "occurs twice") from None
    if member.executable:
        path.chmod(0o755)
    with suppress(OverflowError, ValueError):  # a time that the file system cannot store
        os.utime(path, (member.modified, member.modified))


def _link(archive: Path, path: Path, target: str) -> None:
    if PurePosixPath(target).is_absolute() or not target or "\0" in target:
        raise _refused(archive, path.name, f"is a link to the absolute or empty path `{target}`")
    try:
        path.symlink_to(target)
    except FileExistsError:
        raise _refused(archive, path.name, "occurs twice") from None


def _refused(archive: Path, name: str, why: str) -> InputError:
    return InputError(
        f"{archive}: rejected, because `{name}` {why}. Nothing was imported.",
        hint="pack the campaign again without this entry",
    )


@contextmanager
def _members(archive: Path, room: _Room) -> Iterator[Iterator[Member]]:
    """The entries of an archive, which is open meanwhile."""
    if os.path.exists(archive) and not os.path.isfile(archive) and not os.path.isdir(archive):
        raise InputError(f"{archive}: is not a regular file", hint="name the archive itself")
    try:
        with archive.open("rb") as file:
            begin = file.read(len(_ZIP[0]))
            file.seek(0)
            is_zip = begin in _ZIP
            _refuse_unsupported(archive, begin)
            if is_zip:
                with zipfile.ZipFile(file) as zipped:
                    yield _zip_members(archive, zipped)
            else:
                with tarfile.open(fileobj=file, mode="r:*", tarinfo=_entry_type(room)) as tar:
                    yield _tar_members(tar)
                    _read_to_the_end(archive, tar)
    except (OSError, *_DAMAGED) as error:
        if isinstance(error, OSError) and error.filename == str(archive):
            raise InputError(f"{archive}: cannot be read: {error.strerror}.") from None
        if isinstance(error, OSError) and (
            error.filename is not None or error.errno not in _DAMAGED_CODES
        ):
            raise
        raise InputError(
            f"{archive}: is not a campaign's archive, or is damaged or incomplete "
            f"({_cause(error)})",
            hint="download it again",
        ) from error


def _cause(error: BaseException) -> str:
    """The error in one line; `tarfile` gives a line for each compression that does not match."""
    lines = str(error).splitlines() or [type(error).__name__]
    return lines[0] if len(lines) == 1 else "it does not begin like a tar or zip file"


def _refuse_unsupported(archive: Path, begin: bytes) -> None:
    if begin.startswith(_ZSTD):
        raise InputError(
            f"{archive}: is compressed with zstd, which is not supported",
            hint=f"decompress it: `zstd -d {shlex.quote(str(archive))}`, and import the result",
        )


def _read_to_the_end(archive: Path, tar: tarfile.TarFile) -> None:
    """Read the rest, so that the checksum at the very end of a compressed file is verified.

    Raises:
        InputError: something follows the end, such as a second archive.
    """
    while tar.fileobj is not None and (rest := tar.fileobj.read(CHUNK)):
        if rest.strip(b"\0"):
            raise InputError(
                f"{archive}: has more content after the end of its archive, as several archives "
                "in one file have",
                hint="split it, and import each one",
            )


def _tar_members(tar: tarfile.TarFile) -> Iterator[Member]:
    known: list[tarfile.TarInfo] = vars(tar)["members"]
    while (item := tar.next()) is not None:
        known.clear()  # else all metadata stays in memory
        yield _tar_member(tar, item)


def _tar_member(tar: tarfile.TarFile, item: tarfile.TarInfo) -> Member:
    if item.size < 0:  # of a pax header
        raise tarfile.ReadError(f"an entry of {item.size} bytes")
    kinds: dict[Literal["file", "folder", "link", "copy"], bool] = {
        "file": item.isreg(),
        "copy": item.islnk(),
        "folder": item.isdir(),
        "link": item.issym(),
    }
    return Member(
        name=item.name,
        kind=next((kind for kind, holds in kinds.items() if holds), "other"),
        open=lambda: tar.extractfile(item),
        executable=bool(item.mode & 0o100),
        modified=item.mtime,
        target=item.linkname,
    )


def _target(zipped: zipfile.ZipFile, item: zipfile.ZipInfo) -> str:
    with zipped.open(item) as content:
        return os.fsdecode(content.read(_LONGEST_TARGET))


def _zip_members(archive: Path, zipped: zipfile.ZipFile) -> Iterator[Member]:
    for item in zipped.infolist():
        if item.flag_bits & _ENCRYPTED:
            raise InputError(
                f"{archive}: is encrypted",
                hint="unpack it with its password, and import an archive without one",
            )
        mode = item.external_attr >> 16
        link = stat.S_ISLNK(mode)
        yield Member(
            name=item.filename,
            kind="link" if link else "folder" if item.filename.endswith("/") else "file",
            open=lambda item=item: zipped.open(item),  # type: ignore[misc]
            executable=bool(mode & 0o100),
            modified=mktime((*item.date_time, 0, 0, -1)),
            target=_target(zipped, item) if link else "",
        )
