"""Settings above the working directory are obeyed only if they are the caller's own, or root's."""

import logging
import os
from pathlib import Path

import pytest

from robovast.base.environment import environment
from robovast.base.errors import InputError
from robovast.base.trusted_files import find_above
from robovast.model.project import find_project
from robovast.storage.shares.campaigns import open_share

NAME = ".robovast_project"
OTHER = 65534
"""A user who is neither the caller nor root."""

as_root = pytest.mark.skipif(os.getuid() != 0, reason="only root gives files to other users")


@pytest.fixture
def below(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder two levels below one with settings."""
    monkeypatch.setenv("HOME", "/nonexistent")
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    (tmp_path / NAME).write_text("config: e.vast\n")
    (tmp_path / ".env").write_text("ROBOVAST_SOMETHING=set\n")
    return folder


def found(below: Path) -> tuple[bool, bool]:
    """Whether the project and the environment are obeyed."""
    return find_project(below) is not None, "ROBOVAST_SOMETHING" in environment(below)


def test_own_settings_are_found(below: Path) -> None:
    assert found(below) == (True, True)
    assert found(below.parents[1]) == (True, True), "in the folder itself, too"


@as_root
@pytest.mark.parametrize("levels", [0, 2])
def test_settings_of_another_user_are_not_obeyed(
    below: Path, levels: int, caplog: pytest.LogCaptureFixture
) -> None:
    for name in (NAME, ".env"):
        os.chown(below.parents[1] / name, OTHER, OTHER)
    with caplog.at_level(logging.WARNING):
        assert found([below, below.parent, below.parents[1]][levels]) == (False, False)
        found(below)
    text = f"{below.parents[1] / NAME} is not used, because it belongs to another user"
    assert caplog.text.count(text) == 1, "once, with the path"


@as_root
def test_a_link_of_another_user_is_not_obeyed(below: Path) -> None:
    (below / "mine").write_text("config: e.vast\n")
    (below / NAME).symlink_to(below / "mine")
    assert find_above(below, NAME) == below / NAME
    os.chown(below / NAME, OTHER, OTHER, follow_symlinks=False)
    assert find_above(below, NAME) is None
    os.chown(below / NAME, 0, 0, follow_symlinks=False)
    os.chown(below / "mine", OTHER, OTHER)
    assert find_above(below, NAME) is None


@pytest.mark.parametrize("mode", [0o666, 0o646, 0o602])
def test_settings_that_others_can_write_are_not_obeyed(below: Path, mode: int) -> None:
    for name in (NAME, ".env"):
        (below.parents[1] / name).chmod(mode)
    assert found(below) == (False, False)


def test_the_search_ends_at_the_home_folder(below: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(below.parent))
    assert found(below) == (False, False)
    monkeypatch.setenv("HOME", str(below.parents[1]))
    assert found(below) == (True, True)


def test_the_search_ends_at_another_file_system(
    below: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = {below: 1, below.parent: 1}
    monkeypatch.setattr("robovast.base.trusted_files._device", lambda path: devices.get(path, 2))
    assert found(below) == (False, False)


def test_code_is_named_in_the_environment_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "evil.py").write_text(
        f"open({str(tmp_path / 'loaded')!r}, 'w')\nclass Share: pass\n"
    )
    (tmp_path / ".env").write_text("ROBOVAST_SHARE_TYPE=evil.py:Share\n")
    monkeypatch.delenv("ROBOVAST_SHARE_TYPE", raising=False)
    with pytest.raises(InputError, match=r"a `\.env` file cannot name"), open_share(tmp_path):
        pass
    assert not (tmp_path / "loaded").exists()
