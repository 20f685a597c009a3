"""The files of runs are found, whatever the runs made of their folders."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robovast.analysis.postprocessing.content import scan
from robovast.campaign.checksums import checksums


@pytest.mark.parametrize(("name", "levels"), [("d" * 200, 40), ("d", 1500)])
def test_a_run_may_nest_folders_deeper_than_paths_can_tell(
    tmp_path: Path, name: str, levels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "test.xml").write_text("passed")
    monkeypatch.chdir(tmp_path)
    for _ in range(levels):
        os.mkdir(name)
        os.chdir(name)
        Path("odom.csv").touch()
    found = scan(tmp_path)
    assert "test.xml" in found
    assert f"{name}/{name}/odom.csv" in found
    assert checksums(tmp_path) is None
