"""Below a folder that others write nothing leads out, nothing hangs, nothing fills the memory."""

import os
import re
import resource
import socket
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import pytest

from robovast.base import safe_paths

GIB = 1 << 30
SOURCE = Path(safe_paths.__file__).parents[1]
READERS = ("analysis", "campaign", "common", "evaluation", "mcp", "model", "search")
"""Packages that read campaigns of others."""


@pytest.mark.parametrize("package", READERS)
def test_a_question_about_a_path_of_others_raises_no_error(package: str) -> None:
    """`Path.is_file()` does, for example for a link to a name that is too long."""
    raising = re.compile(r"\.(exists|is_(file|dir|symlink))\(\)")
    files = (SOURCE / package).rglob("*.py")
    assert not [str(file) for file in files if raising.search(file.read_text())]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A folder that somebody else writes."""
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


@pytest.fixture
def host(tmp_path: Path) -> Path:
    """What is nobody's business: a folder with a secret in it."""
    (tmp_path / "host").mkdir()
    (tmp_path / "host" / "key").write_text("secret")
    return tmp_path / "host"


def content(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@contextmanager
def endless(change: Callable[[], None]) -> Iterator[None]:
    """Somebody who does something all the time, while something else is done."""
    stop = Event()

    def work() -> None:
        while not stop.is_set():
            with suppress(OSError):
                change()

    thread = Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def make_pipe(path: Path) -> None:
    os.mkfifo(path)


def make_socket(path: Path) -> None:
    with tempfile.TemporaryDirectory() as short:  # the name of a socket is short
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(f"{short}/s")
        Path(short, "s").rename(path)


def make_link(path: Path) -> None:
    (path.parent / "other").write_text("inside")
    path.symlink_to("other")


@pytest.mark.parametrize("make", [make_pipe, make_socket, make_link, Path.mkdir])
def test_only_regular_files_are_opened(out: Path, make: Callable[[Path], object]) -> None:
    make(out / "x")
    with pytest.raises(OSError, match=r"is a folder|is a link|is not a regular file"):
        safe_paths.open_file(out / "x")


def test_a_link_on_the_way_is_not_followed(out: Path, host: Path) -> None:
    (out / "a").symlink_to(host)
    assert safe_paths.read_file(out / "a" / "key") == b"secret", "its own folder is the root"
    with pytest.raises(NotADirectoryError):
        safe_paths.open_file(out / "a" / "key", root=out)
    assert not safe_paths.is_file(out / "a" / "key", out)
    assert not safe_paths.is_folder(out / "a", out)
    assert safe_paths.names(out / "a", out) == []


def test_the_root_itself_may_be_a_link(out: Path, host: Path) -> None:
    (out / "root").symlink_to(host)
    assert safe_paths.read_file(out / "root" / "key", root=out / "root") == b"secret"


def test_nothing_is_read_past_the_root(out: Path, host: Path) -> None:
    with pytest.raises(OSError, match="leads out of its folder"):
        safe_paths.open_file(out / ".." / "host" / "key", root=out)


def test_a_file_of_a_gigabyte_takes_no_memory(out: Path) -> None:
    with (out / "x").open("wb") as file:
        file.truncate(GIB)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(OSError, match="is larger than"):
        safe_paths.read_file(out / "x")
    assert safe_paths.read_end(out / "x", out, 10)[0] == b"\0" * 10
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 32 << 10, "KiB"


def test_a_new_file_takes_the_place_of_a_link(out: Path, host: Path) -> None:
    (out / "x").symlink_to(host / "key")
    with safe_paths.create_file(out / "x", out) as file:
        file.write(b"ours")
    assert content(host) == {"key": "secret"}
    assert (out / "x").read_text() == "ours"


def test_folders_are_made_in_place_of_links(out: Path, host: Path) -> None:
    (out / "a").symlink_to(host)
    safe_paths.make_folder(out / "a" / "b", out)
    assert list(host.iterdir()) == [host / "key"]
    assert (out / "a" / "b").is_dir()


def test_links_move_as_links(out: Path, host: Path, tmp_path: Path) -> None:
    (out / "run" / "deep").mkdir(parents=True)
    (out / "run" / "deep" / "link").symlink_to(host / "key")
    safe_paths.move(out / "run", out, tmp_path / "stored" / "v" / "0", tmp_path)
    assert (tmp_path / "stored" / "v" / "0" / "deep" / "link").readlink() == host / "key"
    assert not (out / "run").exists()


def test_what_cannot_be_renamed_is_copied(out: Path, host: Path, tmp_path: Path) -> None:
    there = Path(tempfile.mkdtemp(dir="/dev/shm"))  # another file system
    try:
        (out / "run" / "deep").mkdir(parents=True)
        (out / "run" / "deep" / "link").symlink_to(host / "key")
        (out / "run" / "program").write_text("x")
        (out / "run" / "program").chmod(0o4755)
        make_pipe(out / "run" / "pipe")
        with (out / "run" / "sparse").open("wb") as file:
            file.truncate(64 * GIB)
            file.seek(32 * GIB)
            file.write(b"content")
        safe_paths.move(out / "run", out, there / "run", there)
        assert (there / "run" / "deep" / "link").readlink() == host / "key"
        assert stat.S_IMODE((there / "run" / "program").stat().st_mode) == 0o755
        assert sorted(os.listdir(there / "run")) == ["deep", "program", "sparse"]
        assert (there / "run" / "sparse").stat().st_size == 64 * GIB
        assert (there / "run" / "sparse").stat().st_blocks < 1000
        with (there / "run" / "sparse").open("rb") as file:
            file.seek(32 * GIB)
            assert file.read(7) == b"content"
        assert not (out / "run").exists()
    finally:
        safe_paths.remove(there, there.parent)


def test_nothing_is_overwritten(out: Path, tmp_path: Path) -> None:
    (out / "a").write_text("new")
    (tmp_path / "b").write_text("old")
    with pytest.raises(FileExistsError):
        safe_paths.move(out / "a", out, tmp_path / "b", tmp_path)


def test_a_folder_that_nobody_may_enter_is_moved_and_removed(out: Path, tmp_path: Path) -> None:
    (out / "run" / "inner").mkdir(parents=True)
    (out / "run" / "inner" / "file").write_text("x")
    (out / "run" / "inner").chmod(0)
    (out / "run").chmod(0)
    safe_paths.move(out / "run", out, tmp_path / "run", tmp_path)
    safe_paths.remove(tmp_path / "run", tmp_path)
    assert not (tmp_path / "run").exists()


def test_no_depth_is_too_much_to_be_removed(out: Path, host: Path) -> None:
    at = os.open(out, os.O_RDONLY)
    for _ in range(1500):
        os.mkdir("d", dir_fd=at)
        os.symlink(host, "link", dir_fd=at)
        below = os.open("d", os.O_RDONLY, dir_fd=at)
        os.close(at)
        at = below
    os.close(at)
    safe_paths.remove(out / "d", out)
    safe_paths.remove(out / "none", out)
    assert sorted(os.listdir(out)) == ["link"]
    assert content(host) == {"key": "secret"}


def test_a_pinned_folder_stays_what_it_was(out: Path, host: Path) -> None:
    (out / "jobs" / "job-0").mkdir(parents=True)
    (out / "jobs" / "job-0" / "log").write_text("own")
    with safe_paths.pinned(out / "jobs", out) as jobs:
        (out / "jobs").rename(out / "taken")
        (out / "jobs").symlink_to(host)
        assert content(jobs / "job-0") == {"log": "own"}
    with pytest.raises(NotADirectoryError), safe_paths.pinned(out / "jobs", out):
        pass


def test_empty_folders_alone_are_pruned(out: Path, host: Path) -> None:
    (out / "a" / "b" / "c").mkdir(parents=True)
    (out / "x" / "y").mkdir(parents=True)
    (out / "x" / "file").write_text("kept")
    (out / "link").symlink_to(host)
    safe_paths.remove_empty_folders(out, out)
    assert sorted(p.name for p in out.rglob("*")) == ["file", "link", "x"]


def test_a_folder_that_becomes_a_link_meanwhile_leads_nowhere(
    out: Path, host: Path, tmp_path: Path
) -> None:
    """Whatever of both is found, nothing of the host is moved, read, written or removed."""
    (out / "real").mkdir()

    def flip() -> None:
        os.rename(out / "real", out / "a")
        os.rename(out / "a", out / "real")
        os.symlink(host, out / "a")
        os.unlink(out / "a")

    read, stored = set(), tmp_path / "stored"
    stored.mkdir()
    with endless(flip):
        for number in range(500):
            with suppress(OSError):
                (out / "real" / "key").write_text("own")
            with suppress(OSError):
                read.add(safe_paths.read_file(out / "a" / "key", root=out))
            with suppress(OSError):
                safe_paths.move(out / "a" / "key", out, stored / f"{number}", stored)
            with suppress(OSError):
                safe_paths.create_file(out / "a" / "new", out).close()
            with suppress(OSError):
                safe_paths.remove(out / "a" / "key", out)
            with suppress(OSError):
                safe_paths.make_folder(out / "a" / "folder", out)
    assert content(host) == {"key": "secret"}
    assert list(host.iterdir()) == [host / "key"]
    assert read <= {b"own", b""}
    assert {path.read_text() for path in stored.iterdir()} <= {"own", ""}
