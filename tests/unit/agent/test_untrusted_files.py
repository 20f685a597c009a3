"""What of a folder that a run wrote is stored, and what is said of the rest."""

from __future__ import annotations

import errno
import os
import resource
import shutil
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import BinaryIO

import pytest

from robovast.agent import untrusted_files
from robovast.agent.untrusted_files import open_files, store_files
from robovast.base import safe_paths
from robovast.campaign.reserved_names import set_own_names_aside
from robovast.campaign.run_files import MissingFile, room_of

NOBODY = 65534


def contents(root: Path) -> tuple[dict[str, bytes], dict[str, str]]:
    """Files by path, and why others are missing."""

    def store(path: str, _: int, file: BinaryIO) -> tuple[str, bytes]:
        return path, os.pread(file.fileno(), 1000, 0)

    stored, missing = store_files(root, store)
    return dict(stored), {file.path: file.reason for file in missing.first()}


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A folder that everybody reaches."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o777)
    yield folder
    shutil.rmtree(folder)


def test_only_files_are_read(tmp_path: Path) -> None:
    root = tmp_path / "run"
    (root / "a" / "b").mkdir(parents=True)
    (root / "a" / "b" / "file").write_text("content")
    (root / "link").symlink_to(root / "a" / "b" / "file")
    (root / "folder").symlink_to(root / "a")
    os.mkfifo(root / "pipe")
    found, missing = contents(root)
    assert found == {"a/b/file": b"content"}
    link = "it is a link, which is not followed"
    assert missing == {"folder": link, "link": link, "pipe": "it is not a regular file"}
    assert contents(root / "folder") == ({}, {})
    assert contents(root / "none") == ({}, {})


def test_names_that_are_no_text_are_told_apart(tmp_path: Path) -> None:
    for name in (b"map_\xe4.pgm", b"map_\xf6.pgm", "map_ä.pgm".encode()):
        Path(os.fsdecode(os.fsencode(tmp_path) + b"/" + name)).write_bytes(name)
    found, missing = contents(tmp_path)
    assert {os.fsencode(path): content for path, content in found.items()} == {
        name: name for name in (b"map_\xe4.pgm", b"map_\xf6.pgm", "map_ä.pgm".encode())
    }
    assert not missing


def as_nobody(root: Path) -> tuple[dict[str, bytes], dict[str, str]]:
    """As a user whom modes keep out."""
    arguments = (NOBODY,) if os.getuid() == 0 else (os.getuid(),)
    with ProcessPoolExecutor(
        1, get_context("fork"), initializer=os.setuid, initargs=arguments
    ) as pool:
        return pool.submit(contents, root).result(30)


def test_a_mode_of_its_own_keeps_no_file_out(open_folder: Path) -> None:
    root = open_folder / "run"
    (root / "closed").mkdir(parents=True)
    for name in ("closed/a", "b", "script"):
        (root / name).write_text(name)
    owner = NOBODY if os.getuid() == 0 else os.getuid()
    for path in (root / "closed" / "a", root / "b", root / "closed", root):
        os.chown(path, owner, -1)
        path.chmod(0)
    assert as_nobody(root) == ({n: n.encode() for n in ("closed/a", "b", "script")}, {})


def test_what_another_user_keeps_to_himself_is_told(open_folder: Path) -> None:
    if os.getuid() != 0:
        pytest.skip("only root can give files away")
    root = open_folder / "run"
    (root / "closed").mkdir(parents=True)
    (root / "closed" / "a").write_text("a")
    (root / "b").write_text("b")
    (root / "c").write_text("c")
    (root / "closed").chmod(0)
    (root / "b").chmod(0)
    found, missing = as_nobody(root)
    assert found == {"c": b"c"}
    denied = os.strerror(errno.EPERM)
    assert missing == {"b": denied, "closed": denied}


def close_first(files: Iterator[tuple[str, BinaryIO | OSError]]) -> None:
    path, file = next(files)
    assert path == "a"
    assert not isinstance(file, OSError)
    file.close()


def test_what_vanishes_or_cannot_be_read_is_told(tmp_path: Path) -> None:
    for name in "abc":
        (tmp_path / name).write_text(name)

    def store(path: str, _: int, file: BinaryIO) -> str:
        if path == "b":
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return path

    stored, missing = store_files(tmp_path, store)
    assert sorted(stored) == ["a", "c"]
    assert missing.first() == (MissingFile("b", "Input/output error"),)

    files = open_files(tmp_path)
    close_first(files)
    (tmp_path / "b").unlink()
    path, error = next(files)
    assert path == "b"
    assert isinstance(error, FileNotFoundError)


def test_no_more_open_files_are_allowed_is_told(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("a")
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    (tmp_path / "b").write_text("b")
    files = open_files(tmp_path)
    close_first(files)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, before[1]))
    try:
        path, error = next(files)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert path == "b"
    assert isinstance(error, OSError)
    assert error.errno == errno.EMFILE


def test_a_folder_of_any_depth_is_told_not_fatal(tmp_path: Path) -> None:
    deep = os.open(tmp_path, os.O_RDONLY)
    for _ in range(1500):
        os.mkdir("d", dir_fd=deep)
        below = os.open("d", os.O_RDONLY, dir_fd=deep)
        os.close(deep)
        deep = below
    os.close(deep)
    (tmp_path / "file").write_text("x")
    found, missing = contents(tmp_path)
    assert found == {"file": b"x"}
    assert list(missing.values()) == ["it is more than 200 folders deep"]
    safe_paths.remove(tmp_path / "d", tmp_path)


def test_a_file_of_holes_is_not_made_terabytes_of_the_storage(tmp_path: Path) -> None:
    for name, size in (("sparse", 3 << 40), ("small", 1 << 20)):
        (tmp_path / name).write_bytes(b"begin")
        os.truncate(tmp_path / name, size)
    found, missing = contents(tmp_path)
    assert set(found) == {"small"}
    assert "of its 3298534883328 bytes were never written" in missing["sparse"]


def test_a_run_may_call_its_files_as_we_do(tmp_path: Path) -> None:
    root = tmp_path / "run"
    root.mkdir()
    (root / "run.json").write_text("its own")
    (root / "job").mkdir()
    (root / "job" / "x").write_text("x")
    (root / "job.1").write_text("y")
    set_own_names_aside(root)
    assert contents(root)[0] == {"run.json.1": b"its own", "job.2/x": b"x", "job.1": b"y"}
    set_own_names_aside(root)
    set_own_names_aside(tmp_path / "none")
    assert len(list(root.iterdir())) == 3


def test_what_has_no_room_in_the_list_is_counted_and_files_come_before_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(untrusted_files, "ROOM", 20 * room_of("data/00000"))
    (tmp_path / "data").mkdir()
    for number in range(100):
        (tmp_path / "data" / f"{number:05}").write_text("x")
    for name in ("a.csv", "test.xml", "z.log"):
        (tmp_path / name).write_text("x")
    stored, missing = store_files(tmp_path, lambda path, number, file: path)
    assert {"a.csv", "test.xml", "z.log", "data/00000"} <= set(stored)
    (beyond,) = missing.first()
    assert beyond.count == 103 - len(stored)
    assert "the list of a run's files is full" in beyond.reason
