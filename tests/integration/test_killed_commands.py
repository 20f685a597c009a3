"""`vast` is killed before each of its operations on files: nothing incomplete is counted.

The command that is repeated completes, and leaves what a command leaves that was never killed.
"""

from __future__ import annotations

import io
import json
import shutil
import tarfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.finished import NAME, finished_campaign
from support.faults.killing import states

from robovast.base.errors import InputError
from robovast.campaign.discovery import find_campaigns
from robovast.campaign.imported import is_imported
from robovast.storage.download import Silent, download_campaign
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore
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
RUNS = ("c-1/0", "c-1/1", "c-2/0", "c-2/1")
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
    return sources


def vast(*words: str) -> int:
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
        try:
            command()(list(words), prog_name="vast")
        except SystemExit as end:
            return int(end.code or 0)
    raise AssertionError(said.getvalue())


def succeed(*words: str) -> None:
    assert vast(*words) == 0


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
    shutil.copy(sources / "share.py", place)
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
    monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "share.py:Share")
    whole = tmp_path / "whole"
    whole.mkdir()
    given = words(sources, whole)
    monkeypatch.chdir(whole)
    copies = list(states(tmp_path / "states", whole, lambda: succeed(*given)))
    (campaign,) = campaigns(whole / "results")
    expected = tree(campaign)
    assert len([path for path in expected if path.endswith("run.json")]) in (4, 6)
    appeared = []
    for number, place in enumerate(copies):
        found = campaigns(place / "results")
        appeared.append(len(found))
        assert all(tree(path) == expected for path in found)
        if not number % 12 or place == copies[-1]:
            monkeypatch.chdir(place)
            again = vast(*words(sources, place))
            assert again == 0 or (again == 5 and found), number
            (path,) = campaigns(place / "results")
            assert tree(path) == expected
    assert appeared == sorted(appeared)
    assert (appeared[0], appeared[-1]) == (0, 1)


def test_runs_of_a_bucket_appear_complete_or_not_at_all(
    s3_server: Server, tmp_path: Path, sources: Path
) -> None:
    def connected() -> ObjectStore:
        keys = Credentials(s3_server.access_key, s3_server.secret_key)
        return ObjectStore(Endpoint.parse(f"http://{s3_server.endpoint}"), keys, patience=20)

    store, bucket = connected(), f"killed-{uuid4().hex[:12]}"
    store.make_bucket(bucket)
    for name, content in tree(sources / "results" / NAME).items():
        if not name.startswith("_jobs") and "/job/" not in name:
            store.put_bytes(bucket, name, content)
    whole = tmp_path / "whole" / NAME
    whole.mkdir(parents=True)

    def download(target: Path) -> None:
        download_campaign(connected(), bucket, target, Silent(), imported=True)

    copies = list(states(tmp_path / "states", whole, lambda: download(whole)))
    expected = tree(whole)
    runs = {run: tree(whole / run) for run in RUNS}
    assert len(copies) > 10
    for number, place in enumerate(copies):
        for run, files in runs.items():
            assert not (place / run).exists() or tree(place / run) == files, number
        assert is_imported(place) or not (place / "_config").exists()
        if not number % 12:
            download(place)
            assert tree(place) == expected


def test_tables_are_complete_after_postprocessing_was_killed(
    sources: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def counted(results: Path) -> object:
        capfd.readouterr()
        words = ("results", "query", "SELECT count(*) AS n FROM out", "-o", "json")
        command_code = _printed(*words, "-r", str(results))
        said = capfd.readouterr().out
        return json.loads(said) if command_code == 0 else None

    whole = tmp_path / "whole"
    shutil.copytree(sources / "results" / NAME, whole / NAME, symlinks=True)
    words = ("results", "postprocess", "-r")
    copies = list(states(tmp_path / "states", whole, lambda: succeed(*words, str(whole))))
    expected, answer = set(tree(whole)), counted(whole)
    assert answer == [{"n": 4}]
    for number, results in enumerate(copies):
        assert counted(results) in (None, answer), number
        if not number % 12:
            succeed(*words, str(results))
            assert counted(results) == answer
            assert set(tree(results)) == expected


def _printed(*words: str) -> int:
    try:
        command()(list(words), prog_name="vast")
    except SystemExit as end:
        return int(end.code or 0)
    raise AssertionError(words)
