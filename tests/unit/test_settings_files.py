"""Files of settings at or above the working directory that have no usable content."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import pytest

from robovast.base.environment import dotenv_loaded
from robovast.base.errors import RobovastError
from robovast.model.document import load_document
from robovast.model.project import PROJECT_FILE, find_project
from robovast.model.scenario import read_scenarios


def read_all(folder: Path, name: str) -> None:
    """Read a file in the way that its name demands."""
    if name == ".env":
        with dotenv_loaded(folder):
            pass
    elif name == PROJECT_FILE:
        project = find_project(folder)
        assert project is not None
        project.vast_file.is_file()
        project.results_dir.is_dir()
    elif name.endswith(".osc"):
        read_scenarios(folder / name)
    else:
        load_document(folder / name)


NAMES = [".env", PROJECT_FILE, "a.vast", "a.osc"]


@pytest.mark.parametrize("name", NAMES)
def test_a_file_of_a_terabyte_is_refused_in_little_memory(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    os.truncate(tmp_path / name, 1 << 40)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(RobovastError, match="is larger than 64 MiB"):
        read_all(tmp_path, name)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300 << 10


UNUSABLE = {
    ".env": [b"A=a\0b\n", b"A\0B=1\n", b"A=\xff\n"],
    PROJECT_FILE: [
        *(b'config: "a\\0b"\n', b"config: a\0b\n", b"config: \xff\n", b"config: " + b"x" * 5000),
        *(b"config: " + b"x" * 300, b"config: a/" + "ä".encode() * 200 + b"/b", b"config: [1]"),
        *(b'config: a\nresults_dir: "a\\0b"\n', b"config: " + b"x/" * 3000),
    ],
    "a.vast": [b"a: \0\n", b"\xff", b"\0"],
    "a.osc": [b"\xff"],
}


@pytest.mark.parametrize(
    ("name", "content"), [(name, one) for name, several in UNUSABLE.items() for one in several]
)
def test_content_that_cannot_be_used_is_an_error_of_ours(
    tmp_path: Path, name: str, content: bytes
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RobovastError):
        read_all(tmp_path, name)
