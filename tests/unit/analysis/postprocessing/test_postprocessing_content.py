"""The files of runs are found, whatever the runs made of their folders."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from robovast.analysis.postprocessing.content import scan
from robovast.base.safe_paths import remove
from robovast.campaign.checksums import checksums


@pytest.fixture(name="run")
def _run(tmp_path: Path) -> Iterator[Path]:
    """A folder whose content pytest could not remove."""
    folder = tmp_path / "0"
    folder.mkdir()
    yield folder
    remove(folder, tmp_path)


@pytest.mark.parametrize(("name", "levels"), [("d" * 200, 40), ("d", 1500)])
def test_a_run_may_nest_folders_deeper_than_paths_can_tell(
    run: Path, name: str, levels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    (run / "test.xml").write_text("passed")
    monkeypatch.chdir(run)
    for _ in range(levels):
        os.mkdir(name)
        os.chdir(name)
        Path("odom.csv").touch()
    found = scan(run)
    assert "test.xml" in found
    assert f"{name}/{name}/odom.csv" in found
    assert checksums(run) is None
