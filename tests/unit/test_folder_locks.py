"""Folders of one program at a time, also where the file system has no locks."""

import errno
import fcntl
import os
from pathlib import Path

import pytest

from robovast.analysis.postprocessing.state import opened
from robovast.base.errors import StorageError
from robovast.base.locks import exclusive_folder, is_locked


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_without_locks_is_one_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def flock(_file: object, _kind: int) -> None:
        raise OSError(number, os.strerror(number))

    (tmp_path / "lock").touch()
    monkeypatch.setattr(fcntl, "flock", flock)
    folder = tmp_path / ".running"
    with (
        pytest.raises(StorageError, match=rf"{folder}: its file system has no file locks .*local"),
        exclusive_folder(folder, "busy"),
    ):
        pass
    with pytest.raises(StorageError, match="no file locks"), opened(tmp_path):
        pass
    with pytest.raises(StorageError, match="no file locks"):
        is_locked(tmp_path)


def test_a_lock_that_is_a_link_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "other").write_text("content")
    (tmp_path / "folder" / "lock").symlink_to(tmp_path / "other")
    with pytest.raises(OSError, match="symbolic links"), exclusive_folder(tmp_path / "folder", ""):
        pass
    assert (tmp_path / "other").read_text() == "content"


def test_a_folder_in_use_is_locked(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    with exclusive_folder(folder, "busy"):
        assert is_locked(folder)
        with (
            pytest.raises(StorageError, match="busy"),
            exclusive_folder(tmp_path / "folder", "busy"),
        ):
            pass
    assert not is_locked(folder)
