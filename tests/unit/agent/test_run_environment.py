"""What a run finds in its environment, whatever the scripts around it call their own variables."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest
from support.patience import PATIENCE, eventually

from robovast.agent.container_control import RunContainer
from robovast.agent.job_files import write_environment
from robovast.agent.mounts import Folders
from robovast.agent.scripts import AWAIT, SHELL, START
from robovast.execution.generate import copy_file

TOLD = 'env -0 | sort -z | tr "\\0" "\\n"'
NAMES = sorted(set(re.findall(r"\b[a-z]\w*\b", AWAIT.read_text() + START.read_text())))
"""Every word of the scripts, among them the names of their variables and of what they call."""


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    return Folders(work=tmp_path)


def executed(
    folders: Folders, image: Mapping[str, str], job: Mapping[str, str], *names: str
) -> list[str]:
    """What the entrypoints find of two jobs in one container."""
    found, container = [], RunContainer(folders)
    container.begin()
    container.prepare()
    for name in ("entrypoint.sh", "secondary_entrypoint.sh"):
        (folders.config / name).write_text(f"{{ {TOLD}; }} >$OUTPUT_DIR\n")
    process = subprocess.Popen(
        [*SHELL, "-c", AWAIT.read_text(), str(folders.orders / START.name), *names],
        env={**os.environ, **image},
    )
    try:
        for number in (1, 2):
            told = folders.work / f"told{number}"
            variables = {**job, "ROBOVAST_OUT_DIR": str(folders.out), "OUTPUT_DIR": str(told)}
            write_environment(folders, variables)
            container.run(number)
            copy_file(START, folders.orders / START.name)
            eventually(
                lambda number=number: (
                    container.all_over(number, names)
                    if names
                    else container.exit_code(number) is not None
                )
            )
            found.append(told.read_text())
        container.end()
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()
    return found


@pytest.mark.parametrize("names", [(), ("nav",)], ids=["main", "secondary"])
def test_a_run_finds_what_its_image_and_its_document_say(
    folders: Folders, names: tuple[str, ...]
) -> None:
    image = dict.fromkeys(NAMES, "the image's")
    job = dict.fromkeys(NAMES[::2], "the document's")
    for told in executed(folders, {**image, "CONTAINER_NAME": "the image's"}, job, *names):
        lines = set(told.splitlines())
        assert {f"{name}={value}" for name, value in {**image, **job}.items()} - lines == set()
        called = {line for line in lines if line.startswith("CONTAINER_NAME=")}
        assert called == {f"CONTAINER_NAME={name}" for name in names}, "by it one knows where it is"


def test_what_an_image_makes_of_a_shell_keeps_no_run_from_being_executed(folders: Folders) -> None:
    """It has functions in place of commands, and a file that every shell reads first."""
    (folders.work / "strict").write_text("set -eu\nIFS=.\nreadonly name=taken job=taken\n")
    image = {f"BASH_FUNC_{name}%%": "() { exit 9; }" for name in ("read", "exec", "kill", "wait")}
    image |= {"BASH_ENV": str(folders.work / "strict"), "CDPATH": "/tmp:/", "SHELLOPTS": "noglob"}
    for told in executed(folders, image, {}):
        lines = told.splitlines()
        assert f"BASH_ENV={folders.work}/strict" in lines
        assert "BASH_FUNC_read%%=() {  exit 9" in lines
        assert "CDPATH=/tmp:/" in lines
