"""Files of the original RoboVAST 2.x are one problem, which names the tool and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from robovast.base.errors import DocumentError, ExitCode
from robovast.model.document import load_document

FILE = """\
metadata: {name: night}
version: VERSION
extends: base.vast
configuration:
- scenario: {speed: 1}
  sut: {nav2.yaml: {speed: 1}}
execution:
  containers:
    sim: {image: a, system_packages: [git]}
  sizing: calibrated
"""


@pytest.mark.parametrize("version", ["2", "3", "4", "'4'"])
def test_all_is_said_at_once(tmp_path: Path, version: str) -> None:
    file = tmp_path / "night.vast"
    file.write_text(FILE.replace("VERSION", version))
    with pytest.raises(DocumentError) as raised:
        load_document(file)
    (problem,) = raised.value.problems
    assert (problem.place.line, problem.key) == (2, "version")
    assert "original RoboVAST 2.x" in problem.message
    counterparts, alone = problem.remedy.split("Its keys without a counterpart: ")
    named = ("`containers`: `execution.image`", "`scenario`: ", "`sizing`: ", "`system_packages`: ")
    assert [name for name in named if name not in counterparts] == []
    assert alone.startswith("`extends`, `sut`.\n")  # `sim` is the name of a container
    assert "docs/how-to/migrate.md" in alone
    assert raised.value.exit_code == ExitCode.BAD_INPUT


@pytest.mark.parametrize("version", ["5", "0", "'1'", "2.5"])
def test_other_versions_are_simply_wrong(tmp_path: Path, version: str) -> None:
    file = tmp_path / "night.vast"
    file.write_text(f"version: {version}\n")
    with pytest.raises(DocumentError, match="must be 1"):
        load_document(file)
