"""`vast` is killed before each of its operations on files: nothing incomplete is counted.

The command that is repeated completes, and leaves what a command leaves that was never killed.
"""

from __future__ import annotations

import io
import json
import os
import shutil
import tarfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from support.campaigns.finished import NAME, finished_campaign
from support.faults.killing import begin_dying, deaths

from robovast.base.errors import InputError
from robovast.campaign.finding import find_campaigns
from robovast_cli.main import command

SHARE = """
import pathlib, shutil
from robovast.execution.cluster_execution.share_providers.base import BaseShareProvider
ARCHIVE = pathlib.Path({archive!r})

class Share(BaseShareProvider):
    def required_env_vars(self): return {{}}
    def build_pod_env(self): return {{}}
    def upload_archive(self, *_): ...
    def list_campaign_archives_with_size(self):
        return [(ARCHIVE.name, ARCHIVE.stat().st_size)]
    def download_archive(self, name, dest, progress=None, offset=0):
        shutil.copy(ARCHIVE, dest)
"""
OWN = {"tables.duckdb", "data.db", "campaign.db"}
"""Files whose bytes are not the same twice."""


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A campaign of four runs, its archive, another campaign, and a share that has the archive."""
    sources = tmp_path / "sources"
    campaign = finished_campaign(sources / "results", 4)
    other = finished_campaign(sources / "results", 2, name="other-2026-02-02-000000")
    for record in other.rglob("run.json"):
        record.write_text(record.read_text().replace("2026-01-01T", "2026-02-02T"))
    with tarfile.open(sources / f"{NAME}.tar.gz", "w:gz") as archive:
        archive.add(campaign, NAME)
    (sources / "share.py").write_text(SHARE.format(archive=str(sources / f"{NAME}.tar.gz")))
    (sources / ".env").write_text("ROBOVAST_SHARE_TYPE=share.py:Share\n")
    return sources


def vast(*words: str) -> int:
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
        try:
            command()(list(words), prog_name="vast")
        except SystemExit as end:
            return int(end.code or 0)
    raise AssertionError(said.getvalue())


def tree(folder: Path) -> dict[str, bytes]:
    """The files below a folder; of databases, only that they exist."""
    return {
        str(path.relative_to(folder)): b"" if path.name in OWN else path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not any(part.startswith(".") for part in path.parts)
    }


def campaigns(results: Path) -> list[Path]:
    """The campaigns that commands find in a folder."""
    try:
        return find_campaigns(results)
    except InputError:
        return []


def imported(sources: Path, place: Path) -> tuple[str, ...]:
    return "import-results", str(sources / f"{NAME}.tar.gz"), "-o", str(place / "results")


def downloaded(sources: Path, place: Path) -> tuple[str, ...]:
    for name in ("share.py", ".env"):
        shutil.copy(sources / name, place)
    return "results", "download", "--from", "share", "-o", str(place / "results")


def merged(sources: Path, place: Path) -> tuple[str, ...]:
    target = place / "results" / "merged-2026-03-03-000000"
    return "results", "merge-campaigns", "-r", str(sources / "results"), str(target)


@pytest.mark.parametrize("words", [imported, downloaded, merged])
def test_a_campaign_appears_complete_or_not_at_all(
    sources: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: Callable[[Path, Path], tuple[str, ...]],
) -> None:
    whole = tmp_path / "whole"
    whole.mkdir()
    given = words(sources, whole)
    monkeypatch.chdir(whole)
    assert vast(*given) == 0
    (campaign,) = campaigns(whole / "results")
    expected = tree(campaign)
    assert len([path for path in expected if path.endswith("run.json")]) in (4, 6)

    def act(place: Path) -> None:
        given = words(sources, place)
        os.chdir(place)
        begin_dying()
        assert vast(*given) == 0

    appeared = []
    for number, place in deaths(tmp_path / "places", act, every=3):
        results = place / "results"
        found = campaigns(results)
        appeared.append(len(found))
        for path in found:
            assert tree(path) == expected
        if not number % 15:
            monkeypatch.chdir(place)
            again = vast(*words(sources, place))
            assert again == 0 or (again == 5 and found), number
            (path,) = campaigns(results)
            assert tree(path) == expected
    assert appeared == sorted(appeared)
    assert appeared[0] == 0


def test_tables_are_complete_after_postprocessing_was_killed(
    sources: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def counted(results: Path) -> object:
        capfd.readouterr()
        words = ("results", "query", "SELECT count(*) AS n FROM out", "-o", "json")
        command_code = _printed(*words, "-r", str(results))
        said = capfd.readouterr().out
        return json.loads(said) if command_code == 0 else None

    def act(place: Path) -> None:
        shutil.copytree(sources / "results" / NAME, place / "results" / NAME)
        begin_dying()
        assert vast("results", "postprocess", "-r", str(place / "results")) == 0

    whole = tmp_path / "whole"
    shutil.copytree(sources / "results" / NAME, whole / "results" / NAME)
    assert vast("results", "postprocess", "-r", str(whole / "results")) == 0
    expected, answer = set(tree(whole / "results")), counted(whole / "results")
    assert answer == [{"n": 4}]
    for number, place in deaths(tmp_path / "places", act, every=11):
        assert counted(place / "results") in (None, answer), number
        if not number % 55:
            assert vast("results", "postprocess", "-r", str(place / "results")) == 0
            assert counted(place / "results") == answer
            assert set(tree(place / "results")) == expected


def _printed(*words: str) -> int:
    try:
        command()(list(words), prog_name="vast")
    except SystemExit as end:
        return int(end.code or 0)
    raise AssertionError(words)
