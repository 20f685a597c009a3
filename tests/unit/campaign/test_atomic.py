"""What has its name is whole, wherever a program is killed; what it leaves is removed."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.faults.killing import begin_dying, deaths
from support.faults.small_disk import small_disk

from robovast.base import atomic
from robovast.base.atomic import (
    appearing_file,
    appearing_folder,
    put_in_place,
    scratch_folder,
    write_atomically,
)
from robovast.base.errors import StorageError
from robovast.base.locks import exclusive_folder


def fill(folder: Path, word: str) -> None:
    folder.mkdir(exist_ok=True)
    for name in ("a", "b"):
        (folder / name).write_text(word)


def content(folder: Path) -> set[str]:
    return {path.read_text() for path in folder.iterdir()}


def replace_a_folder(place: Path) -> None:
    fill(place / "it", "old")
    begin_dying()
    with scratch_folder(place / "it") as part:
        fill(part, "new")
        put_in_place(part, place / "it", replace=True)


def test_a_killed_program_leaves_the_old_folder_or_the_new(tmp_path: Path) -> None:
    seen = []
    for _, place in deaths(tmp_path, replace_a_folder):
        (word,) = content(place / "it")
        seen.append(word)
        assert len(list((place / "it").iterdir())) == 2
        with appearing_folder(place / "other"):
            pass
        assert {path.name for path in place.iterdir()} == {"it", "other"}, "it was left behind"
    assert seen == sorted(seen, reverse=True), "first the old, then the new"
    assert set(seen) == {"old", "new"}


def test_where_folders_cannot_be_exchanged_the_next_writer_puts_the_old_one_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(one: Path, other: Path) -> None:
        raise OSError(errno.EINVAL, "as NFS says")

    monkeypatch.setattr(atomic, "_exchange", refuse)
    for _, place in deaths(tmp_path, replace_a_folder):
        with pytest.raises(StorageError, match="exists already"), appearing_folder(place / "it"):
            pass
        (word,) = content(place / "it")
        assert word in {"old", "new"}
        with appearing_folder(place / "other"):
            pass
        assert {path.name for path in place.iterdir()} == {"it", "other"}


def test_a_killed_program_leaves_the_old_file_or_the_new(tmp_path: Path) -> None:
    def write(place: Path) -> None:
        (place / "file").write_text("old")
        begin_dying()
        write_atomically(place / "file", "new")

    words = [(place / "file").read_text() for _, place in deaths(tmp_path, write)]
    assert set(words) == {"old", "new"}


def test_what_a_living_program_writes_is_left_alone(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path; from robovast.base.atomic import appearing_folder\n"
        "with appearing_folder(Path(sys.argv[1])) as part:\n"
        "    (part / 'a').write_text('mine'); print(flush=True); sys.stdin.read()"
    )
    arguments = [sys.executable, "-c", program, str(tmp_path / "it")]
    with subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with appearing_folder(tmp_path / "other"):
            pass
        process.communicate()
    assert content(tmp_path / "it") == {"mine"}
    assert {path.name for path in tmp_path.iterdir()} == {"it", "other"}


def test_hidden_folders_of_users_are_left_alone(tmp_path: Path) -> None:
    for name in (".git", ".x.part", ".cache.1"):
        (tmp_path / name).mkdir()
    (tmp_path / ".m.123.part").mkdir()  # what an older version left
    with appearing_folder(tmp_path / "it"):
        pass
    assert {path.name for path in tmp_path.iterdir()} == {".git", ".x.part", ".cache.1", "it"}


@pytest.mark.parametrize("name", ["地" * 85, "\udce4" * 255, "x" * 255])
def test_the_longest_names_of_a_file_system_are_fine(tmp_path: Path, name: str) -> None:
    with appearing_file(tmp_path / name) as part:
        part.write_text("content")
    with appearing_folder(tmp_path / "of" / name):
        pass
    assert os.listdir(tmp_path / "of") == [name]


def test_a_full_disk_leaves_no_part_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    with small_disk(100), pytest.raises(OSError, match="large"):
        write_atomically(tmp_path / "file", "x" * 1000)
    assert content(tmp_path) == {"old"}


def test_links_and_pipes_in_a_folder_hinder_nobody(tmp_path: Path) -> None:
    folder = tmp_path / "made"
    folder.mkdir()
    os.mkfifo(folder / "pipe")
    (folder / "circle").symlink_to("circle")
    (folder / "away").symlink_to("/dev/tty")
    put_in_place(folder, tmp_path / "it")
    assert {path.name for path in (tmp_path / "it").iterdir()} == {"pipe", "circle", "away"}


WORKER = """
import sys, time
from pathlib import Path
from robovast.base.errors import StorageError
from robovast.base.locks import exclusive_folder
work, done = Path(sys.argv[1]), 0
print("ready", flush=True)
sys.stdin.readline()
until = time.monotonic() + 180
while done < 10 and time.monotonic() < until:
    try:
        with exclusive_folder(work, "taken"):
            with open(work / "mine", "x"):
                pass
            (work / "mine").unlink()
            done += 1
    except StorageError:
        pass
print(done)
"""


def test_one_of_many_programs_is_in_a_folder_that_each_removes(tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", WORKER, str(tmp_path / ".running")]
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    programs = [subprocess.Popen(arguments, text=True, **pipes) for _ in range(3)]
    assert [program.stdout.readline() for program in programs] == ["ready\n"] * 3
    for program in programs:
        program.stdin.write("begin\n")
        program.stdin.flush()
    assert [program.communicate() for program in programs] == [("10\n", "")] * 3
    assert list(tmp_path.iterdir()) == []


def test_who_waits_for_a_lock_whose_folder_goes_gets_a_folder_of_its_own(tmp_path: Path) -> None:
    work = tmp_path / ".running"
    with exclusive_folder(work, "taken"):
        (work / "mine").touch()
        with pytest.raises(StorageError, match="taken"), exclusive_folder(work, "taken"):
            pass
        assert (work / "mine").exists()
    assert list(tmp_path.iterdir()) == []
