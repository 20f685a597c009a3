"""The command line, called in this process, as a user would."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from robovast_cli.main import command

SCENARIO = """\
import osc.helpers

scenario drive:
    speed: float = 1.0
    distance: float = 5.0
    goal: string = "door"
    do serial:
        wait elapsed(1s)
"""


@dataclass(frozen=True)
class Outcome:
    """What a command left."""

    code: int
    out: str
    err: str

    @property
    def is_one_error(self) -> bool:
        """Whether stderr has one error in the form of docs/contributing/style.md."""
        return re.fullmatch(r"error: .+[^.]\n(hint: .+\n)?", self.err) is not None


Vast = Callable[..., Outcome]


@pytest.fixture
def vast(capsys: pytest.CaptureFixture[str]) -> Iterator[Vast]:
    """Call `vast` with arguments."""
    root = command()
    level = logging.getLogger().level

    def call(*arguments: object) -> Outcome:
        with pytest.raises(SystemExit) as caught:
            root.main(args=[str(argument) for argument in arguments], prog_name="vast")
        captured = capsys.readouterr()
        return Outcome(int(caught.value.code or 0), captured.out, captured.err)

    yield call
    logging.getLogger().setLevel(level)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with a scenario and no .vast file."""
    (tmp_path / "drive.osc").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def sweep(folder: Path) -> Path:
    """A .vast file in the working directory: six configurations and one."""
    path = folder / "drive.vast"
    path.write_text(
        """\
version: 1
# what to vary
configuration:
- name: sweep
  variations:
  - ParameterVariationList: {name: speed, values: [0.5, 1.0, 2.0]}
  - ParameterVariationList: {name: goal, values: [door, "ramp, left"]}
- name: fixed
  parameters:
  - speed: 0.1   # slow
execution:
  scenario_file: drive.osc
  runs: 2
"""
    )
    return path
