"""`vast results publish` and its neighbours: what a user sees, and the exit codes."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

NAME = "my-camp-2026-03-05-121530"
OTHER = "other-2026-03-06-121530"
ZIP = "[{zip: {filename: '{robot}_{timestamp}.zip', destination: out}}]"

UPLOAD = """
class Send:
    plugin_type = "upload"
    def __call__(self, results_dir, config_dir, context):
        return True, "sent " + ", ".join(path.name for path in context.files)

def refuse(results_dir, config_dir):
    return False, "the server is full"
"""


def make_campaign(results: Path, name: str, publication: str = ZIP) -> Path:
    config = results / name / "_config"
    config.mkdir(parents=True)
    (config / "x.vast").write_text(
        f"version: 1\nmetadata: {{robot: r2}}\nresults_processing: {{publication: {publication}}}\n"
    )
    (config / "p.py").write_text(UPLOAD)
    run = results / name / "one" / "0"
    run.mkdir(parents=True)
    (run / "test.xml").write_text('<testsuite time="1"><testcase/></testsuite>')
    (results / name / "one" / "_config").mkdir()
    (results / name / "one" / "_config" / "config.yaml").write_text("config_identifier: A\n")
    return results / name


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    make_campaign(tmp_path / "results", NAME)
    return tmp_path / "results"


def test_campaigns_are_postprocessed_and_packed(vast, results: Path) -> None:
    outcome = vast("results", "publish")
    assert outcome.code == 0, outcome.err
    lines = outcome.out.splitlines()
    assert lines[0].startswith(f"{NAME}: 1 run")
    assert lines[-1].startswith("zip: r2_2026-03-05-121530.zip: ")
    with zipfile.ZipFile(results / "out" / "r2_2026-03-05-121530.zip") as archive:
        assert f"{NAME}/metadata.yaml" in archive.namelist()


def test_results_are_published_as_they_are(vast, results: Path) -> None:
    outcome = vast("results", "publish", "--skip-postprocessing")
    assert outcome.code == 0
    assert not (results / NAME / "metadata.yaml").exists()
    assert "is up to date" in vast("results", "publish", "--skip-postprocessing").out


def test_an_archive_that_differs_is_replaced_on_demand(vast, results: Path) -> None:
    target = results / "out" / "r2_2026-03-05-121530.zip"
    target.parent.mkdir()
    target.write_text("old")
    outcome = vast("results", "publish", "--skip-postprocessing")
    assert outcome.code == 5
    assert "\nhint: use `--force` or `overwrite: true` to replace it" in outcome.err
    assert target.read_text() == "old"
    assert vast("results", "publish", "--skip-postprocessing", "--force").code == 0
    assert zipfile.is_zipfile(target)


def test_some_campaigns_can_be_chosen(vast, results: Path) -> None:
    make_campaign(results, OTHER)
    outcome = vast("results", "publish", "--skip-postprocessing", "-i", OTHER)
    assert outcome.code == 0
    assert [path.name for path in (results / "out").iterdir()] == ["r2_2026-03-06-121530.zip"]
    outcome = vast("results", "publish", "-i", "nothing")
    assert (outcome.code, outcome.out) == (2, "")
    assert f"no campaign `nothing` in results\nhint: use one of {NAME}, {OTHER}\n" in outcome.err


def test_one_campaign_can_be_named_by_its_folder(vast, results: Path) -> None:
    make_campaign(results, OTHER)
    assert vast("results", "publish", "--skip-postprocessing", "-r", results / NAME).code == 0
    assert [path.name for path in (results / "out").iterdir()] == ["r2_2026-03-05-121530.zip"]


def test_uploading_can_be_skipped(vast, results: Path) -> None:
    campaign = make_campaign(results, OTHER, "[p.py:Send, zip]")
    arguments = ("results", "publish", "--skip-postprocessing", "-r", campaign)
    assert vast(*arguments).out.splitlines()[-1] == f"p.py:Send: sent {OTHER}.zip"
    assert vast(*arguments, "--skip-upload").out.startswith(f"zip: {OTHER}.zip is up to date")


def test_another_file_can_say_what_to_publish(vast, results: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.vast").write_text("results_processing: {publication: [zip]}\n")
    outcome = vast("results", "publish", "--skip-postprocessing", "--override", "mine.vast")
    assert outcome.out.startswith(f"zip: {NAME}.zip: ")


@pytest.mark.parametrize(
    ("publication", "code", "message"),
    [
        ("[]", 2, "there is nothing to publish"),
        ("[{zip: {file_name: x}}]", 2, "has no parameter `file_name`\nhint: use one of filename,"),
        ("[{zip: {filename: '{x}.zip'}}]", 2, "\nhint: use one of robot, timestamp\n"),
        ("[{zip: 7}]", 2, "x.vast:3:"),
        ("[ftp]", 2, "there is no plugin `ftp`"),
    ],
)
def test_what_is_wrong_in_the_file_is_explained(
    vast, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, publication: str, code: int, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    make_campaign(tmp_path / "results", NAME, publication)
    outcome = vast("results", "publish", "--skip-postprocessing")
    assert outcome.code == code
    assert message in outcome.err
    assert "Traceback" not in outcome.err


def test_a_plugin_that_fails_gives_its_own_exit_code(vast, results: Path) -> None:
    campaign = make_campaign(results.parent / "r", NAME, "[p.py:refuse]")
    outcome = vast("results", "publish", "--skip-postprocessing", "-r", campaign)
    assert outcome.code == 5
    assert outcome.err == "error: the publication plugin `p.py:refuse` failed: the server is full\n"


def test_plugins_are_listed_with_their_parameters(vast) -> None:
    out = vast("results", "publish-commands").out
    assert "zip  (robovast" in out
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert "bucket required name of the bucket; it is created if missing." in lines
    assert any(line.startswith("omit_hidden default false leave folders") for line in lines)
    assert not any(line.endswith(("default none", "default false")) for line in lines)
    assert "context" not in out


def test_campaigns_are_merged(vast, results: Path) -> None:
    make_campaign(results, OTHER)
    outcome = vast("results", "merge-campaigns", "results/merged")
    assert outcome.code == 0
    assert outcome.out == ("Merged 2 campaigns into results/merged: 1 configuration, 2 runs.\n")
    assert (results / "merged" / "one" / "1" / "test.xml").is_file()
    assert vast("results", "merge-campaigns", "results/merged").code == 5


def test_an_archive_is_imported(vast, results: Path, tmp_path: Path) -> None:
    with tarfile.open(tmp_path / "x.tar.gz", "w:gz") as tar:
        tar.add(results / NAME, NAME)
    outcome = vast("import-results", "x.tar.gz", "-o", "home")
    assert (outcome.code, outcome.out) == (0, f"Imported home/{NAME}.\n")
    assert vast("results", "import-results", "x.tar.gz").code == 5
    assert vast("results", "import-results", "x.tar.gz", "-f").code == 0
    (tmp_path / "evil.tar.gz").write_bytes(archive_of("../evil"))
    outcome = vast("import-results", "evil.tar.gz")
    assert outcome.code == 2
    assert "rejected, because `../evil` is outside" in outcome.err


def archive_of(name: str) -> bytes:
    """An archive with one empty file."""
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w:gz") as tar:
        tar.addfile(tarfile.TarInfo(name))
    return content.getvalue()


SHARE = """
import pathlib
from robovast.execution.cluster_execution.share_providers.base import BaseShareProvider

class Share(BaseShareProvider):
    def required_env_vars(self): return {'MY_TOKEN': 'a token'}
    def build_pod_env(self): return {}
    def upload_archive(self, *_): ...
    def list_campaign_archives_with_size(self):
        return [(path.name, path.stat().st_size) for path in pathlib.Path('shared').iterdir()]
    def remove_archive(self, name): pathlib.Path('shared', name).unlink()
"""


def make_share(folder: Path, sizes: dict[str, int]) -> None:
    """A share that is a folder, with archives of sizes."""
    (folder / "share.py").write_text(SHARE)
    (folder / "shared").mkdir()
    for name, size in sizes.items():
        (folder / "shared" / f"{name}.tar.gz").write_bytes(bytes(size))


def test_a_share_is_listed_and_emptied(
    vast, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_share(tmp_path, {NAME: 2048, "far-away": 10, "far-off": 20})
    outcome = vast("results", "list-share")
    assert outcome.code == 2
    assert "there is no share\nhint: set ROBOVAST_SHARE_TYPE" in outcome.err
    monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "share.py:Share")
    (tmp_path / ".env").write_text("MY_TOKEN=secret-77\n")
    outcome = vast("results", "list-share")
    assert outcome.out.splitlines() == [
        "CAMPAIGN                   SIZE     LOCAL",
        "far-away                   10 B     no",
        "far-off                    20 B     no",
        f"{NAME}  2.0 KiB  yes",
    ]
    assert len(vast("results", "list-share", "-i", "far-*").out.splitlines()) == 3
    outcome = vast("results", "list-share", "-i", "near-*")
    assert (outcome.code, outcome.out) == (2, "")
    outcome = vast("results", "remove-from-share", "-y", "-i", "far-*", "-i", "near")
    assert outcome.code == 2
    assert (
        f"no campaign `near` on the file share\nhint: use one of far-away, far-off, {NAME}\n"
        in (outcome.err)
    )
    assert "secret-77" not in outcome.err + outcome.out
    assert "Deleted" not in outcome.out
    outcome = vast("results", "remove-from-share", "-i", "far-*", "-i", "near*", "-y")
    assert (outcome.code, outcome.out.splitlines()) == (
        0,
        [
            "far-away: 10 B",
            "far-off: 20 B",
            "Deleted far-away from the file share.",
            "Deleted far-off from the file share.",
        ],
    )


@pytest.mark.parametrize(("answer", "code", "left"), [("", 1, 1), ("n\n", 1, 1), ("y\n", 0, 0)])
def test_what_is_removed_from_a_share_is_asked_before(
    folder: Path, answer: str, code: int, left: int
) -> None:
    make_share(folder, {"a": 10})
    (folder / ".env").write_text("MY_TOKEN=x\n")
    environment = {**os.environ, "ROBOVAST_SHARE_TYPE": "share.py:Share"}
    done = subprocess.run(
        [sys.executable, "-m", "robovast_cli", "results", "remove-from-share", "-i", "a"],
        cwd=folder, env=environment, input=answer, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, len(list((folder / "shared").iterdir()))) == (code, left), done


def test_a_described_share_is_where_results_come_from(
    vast, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless the cluster is meant."""
    monkeypatch.setenv("KUBECONFIG", str(folder / "none"))
    (folder / "far-away.tar.gz").write_bytes(archive_of("far-away/_config/x.vast"))
    (folder / "share.py").write_text(
        "import pathlib, shutil\n"
        "from robovast.execution.cluster_execution.share_providers.base import BaseShareProvider\n"
        f"ARCHIVE = pathlib.Path({str(folder)!r}, 'far-away.tar.gz')\n"
        "class Share(BaseShareProvider):\n"
        "    def required_env_vars(self): return {}\n"
        "    def build_pod_env(self): return {}\n"
        "    def upload_archive(self, *_): ...\n"
        "    def list_campaign_archives_with_size(self):\n"
        "        return [(ARCHIVE.name, ARCHIVE.stat().st_size)]\n"
        "    def download_archive(self, name, dest, progress=None, offset=0):\n"
        "        shutil.copy(ARCHIVE, dest)\n"
    )
    outcome = vast("results", "download")
    assert outcome.code == 3
    assert "To download from a file share, set ROBOVAST_SHARE_TYPE" in outcome.err
    assert vast("results", "download", "--from", "share").code == 2
    monkeypatch.setenv("ROBOVAST_SHARE_TYPE", "share.py:Share")
    outcome = vast("results", "download", "-o", "home", "--keep-archive")
    assert (outcome.code, outcome.out) == (0, "home/far-away: downloaded from the file share.\n")
    assert {path.name for path in (folder / "home").iterdir()} == {"far-away", "far-away.tar.gz"}
    outcome = vast("results", "download", "-o", "home")
    assert outcome.out == "home/far-away: already exists. `--force` downloads it again.\n"
    outcome = vast("results", "download", "-i", "other")
    assert outcome.code == 2
    assert (
        "file share\nhint: use one of far-away, or search the object storage with `--from"
        in outcome.err
    )
    assert vast("results", "download", "--from", "cluster").code == 3
    outcome = vast("results", "download", "-n", "lab")
    assert (outcome.code, "ROBOVAST_SHARE_TYPE" in outcome.err) == (3, False)


@pytest.mark.parametrize("filters", ["exclude_filter: ['*.json']", "include_filter: ['*.csv']"])
def test_filters_that_drop_the_records_of_runs_are_reported(
    vast, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, filters: str
) -> None:
    monkeypatch.chdir(tmp_path)
    campaign = make_campaign(tmp_path / "results", NAME, f"[{{zip: {{{filters}}}}}]")
    (campaign / "one" / "0" / "run.json").write_text("{}")
    outcome = vast("results", "publish", "--skip-postprocessing")
    assert outcome.code == 0
    assert "without 1 `run.json`" in outcome.out
    assert "`exclude_filter` that keep `run.json`" in outcome.out
