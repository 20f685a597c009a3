"""No path leaves the folder, whatever it looks like; nothing in it makes a reader hang or swell."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robovast.base.errors import InputError
from robovast.evaluation.confined_files import MissingError, OutsideError, open_inside, read_small
from robovast.evaluation.untrusted_data import parse_json, parse_yaml


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "secret").write_text("outside")
    folder = tmp_path / "results"
    (folder / "run").mkdir(parents=True)
    (folder / "job").mkdir()
    (folder / "job" / "log").write_text("inside")
    return folder


@pytest.mark.parametrize(
    "path", ["../secret", "run/../../secret", "/etc/passwd", "run/../../results/../secret", "a\0b"]
)
def test_a_path_that_leads_out_is_refused(root: Path, path: str) -> None:
    with pytest.raises(OutsideError):
        read_small(root, path)


def test_a_link_that_leads_out_is_refused(root: Path) -> None:
    (root / "run" / "file").symlink_to(root.parent / "secret")
    (root / "run" / "folder").symlink_to(root.parent)
    for path in ("run/file", "run/folder/secret"):
        with pytest.raises(OutsideError):
            read_small(root, path)


def test_a_folder_beside_it_with_the_same_beginning_is_outside(root: Path) -> None:
    (root.parent / "results-of-others").mkdir()
    (root.parent / "results-of-others" / "file").write_text("outside")
    with pytest.raises(OutsideError):
        read_small(root, "../results-of-others/file")


def test_a_link_inside_is_followed(root: Path) -> None:
    (root / "run" / "job").symlink_to(Path("..", "job"))
    assert read_small(root, "run/job/log") == b"inside"


def test_a_loop_of_links_is_refused(root: Path) -> None:
    (root / "loop").symlink_to("loop")
    with pytest.raises(OutsideError):
        read_small(root, "loop")


def test_what_is_no_file_is_not_opened(root: Path) -> None:
    os.mkfifo(root / "pipe")  # reading it would wait for ever
    for path in ("pipe", "run", "none", "job/log/deeper"):
        with pytest.raises(MissingError):
            open_inside(root, path)


def test_a_file_that_is_too_large_is_refused(root: Path) -> None:
    (root / "large").write_bytes(b"x" * 101)
    with pytest.raises(InputError, match="100 bytes"):
        read_small(root, "large", limit=100)


def test_a_small_document_cannot_become_a_large_answer() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)]
    assert parse_yaml("\n".join(lines).encode()) is None


def test_a_document_that_is_too_deep_is_none() -> None:
    assert parse_json(b"[" * 100_000) is None
    assert parse_json(b"[" * 40 + b"]" * 40) is None


def test_numbers_that_a_browser_cannot_hold_become_text() -> None:
    assert parse_json(b'{"stamp": 1772639004000000001, "x": NaN, "y": 1.5}') == {
        "stamp": "1772639004000000001",
        "x": "nan",
        "y": 1.5,
    }
