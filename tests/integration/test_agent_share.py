"""The Job that brings a campaign to a share: a real bucket, real servers, real ends."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.owner import OWNER
from support.campaigns.stored import NAME, write, write_campaign
from support.faults.small_disk import small_disk
from support.patience import PATIENCE
from support.servers.share_places import Place, sftp, webdav

from robovast.agent.bucket import Bucket
from robovast.agent.untrusted_files import store_own_tree
from robovast.base.errors import StorageError
from robovast.campaign.imported import MARK
from robovast.campaign.importing import import_archive
from robovast.storage.compressing import pack_bucket
from robovast.storage.download import Silent, download_campaign
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore
from robovast.storage.shares.campaigns import download_from_share, open_share

pytestmark = pytest.mark.parametrize("s3_server", ["minio"], indirect=True)

ARCHIVE = f"{NAME}.tar.gz"
MIB = 2**20
PROVIDER = """
import os
from robovast.execution.cluster_execution.share_providers.base import BaseShareProvider

class Folder(BaseShareProvider):
    SHARE_TYPE = "folder"

    def required_env_vars(self):
        return {"OUTER": "known on the user's machine only"}

    def build_pod_env(self):
        return {"INNER": os.environ["OUTER"]}

    def upload_archive(self, archive_path, object_name, progress_callback=None):
        if "broken" in os.environ["INNER"]:
            raise ValueError("it is broken")
        with open(archive_path, "rb") as source:
            with open(os.path.join(os.environ["INNER"], object_name), "wb") as target:
                target.write(source.read())
"""


@dataclass
class Stored:
    """A finished campaign in a bucket of its own."""

    store: ObjectStore
    bucket: str
    endpoint: str
    mounts: Path

    def describe(self, variables: dict[str, str], files: dict[str, str] | None = None) -> None:
        """Mount a Secret that describes a share."""
        for name, text in {**variables, **(files or {})}.items():
            write(self.mounts / "share" / name, text)

    def start(self, *, bucket: str = "") -> subprocess.Popen[str]:
        """A new pod of the Job."""
        work = self.mounts / "work"
        write(work / "termination-log", "")
        folders = [f"--{name}={self.mounts / name}" for name in ("credentials", "share", "work")]
        results = [f"--campaign={NAME}", f"--bucket={bucket or self.bucket}"]
        return subprocess.Popen(
            [
                *(sys.executable, "-m", "robovast.agent", "share", *folders, *results),
                *(f"--endpoint={self.endpoint}", f"--message={work / 'termination-log'}"),
            ],
            env={"PATH": os.environ["PATH"], "HOME": str(self.mounts), "PYTHONUNBUFFERED": "1"},
            cwd=work,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def upload(self, *, bucket: str = "") -> tuple[int, str, str]:
        """Exit code, log and termination message of a new pod of the Job."""
        process = self.start(bucket=bucket)
        log, _ = process.communicate(timeout=PATIENCE)
        return process.returncode, log, (self.mounts / "work/termination-log").read_text()


@pytest.fixture(autouse=True)
def own_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in [name for name in os.environ if name.startswith("ROBOVAST_SHARE")]:
        monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def stored(tmp_path: Path, s3_server: Server) -> Iterator[Stored]:
    campaign = write_campaign(tmp_path / "source")
    write(campaign / "_config" / "tool.sh", "#!/bin/sh\n")
    (campaign / "_config" / "tool.sh").chmod(0o755)
    (campaign / "hall-1" / "0" / "bag").write_bytes(os.urandom(6 * MIB))
    write(tmp_path / "mounts/credentials/accessKey", s3_server.access_key)
    write(tmp_path / "mounts/credentials/secretKey", s3_server.secret_key)
    endpoint = f"http://{s3_server.endpoint}"
    keys = Credentials(s3_server.access_key, s3_server.secret_key)
    store = ObjectStore(Endpoint.parse(endpoint), keys, patience=60)
    made = Stored(store, f"test-{uuid4().hex[:12]}", endpoint, tmp_path / "mounts")
    store.make_bucket(made.bucket)
    store_own_tree(Bucket(store, made.bucket, OWNER), campaign)
    yield made
    store.delete_bucket(made.bucket)


@pytest.fixture(params=[webdav, sftp])
def place(request: pytest.FixtureRequest, tmp_path: Path, stored: Stored) -> Iterator[Place]:
    make: Callable[[ExitStack, Path, str], Place] = request.param
    (tmp_path / "server").mkdir()
    with ExitStack() as stack:
        place = make(stack, tmp_path / "server", make.__name__)
        stored.describe({**place.env, "ROBOVAST_SHARE_TYPE": place.kind})
        yield place


def content(campaign: Path) -> dict[str, object]:
    """Every stored file, with its content, mode and time, and every link."""
    found: dict[str, object] = {}
    for path in sorted(campaign.rglob("*")):
        name = path.relative_to(campaign).as_posix()
        if path.is_symlink():
            found[name] = path.readlink()
        elif path.is_file() and name != MARK:
            about = path.stat()
            found[name] = (path.read_bytes(), about.st_mode & 0o777, int(about.st_mtime))
    return found


def test_what_comes_home_from_the_share_is_what_the_bucket_has(
    stored: Stored, place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Links, modes and times included; a second upload makes the very same archive."""
    download_campaign(stored.store, stored.bucket, tmp_path / "direct" / NAME, Silent())
    code, log, message = stored.upload()
    assert code == 0, log
    assert "packed 100%" in log
    assert "uploaded 100%" in log
    assert ARCHIVE in message
    assert place.names() == {ARCHIVE}
    before = place.content(ARCHIVE)
    for name, value in {**place.env, "ROBOVAST_SHARE_TYPE": place.kind}.items():
        monkeypatch.setenv(name, value)
    with open_share() as share:
        download_from_share(share, [], tmp_path / "home")
    assert content(tmp_path / "home" / NAME) == content(tmp_path / "direct" / NAME)
    assert (tmp_path / "home" / NAME / "hall-1/0/job").is_dir()
    assert stored.upload()[0] == 0
    assert place.content(ARCHIVE) == before
    assert not [secret for secret in place.secrets if secret in log + message]
    assert [path.name for path in (stored.mounts / "work").iterdir()] == ["termination-log"]


def test_a_pod_that_is_killed_in_the_middle_leaves_no_half_archive(
    stored: Stored, place: Place, tmp_path: Path
) -> None:
    """The next pod completes it."""
    process = stored.start()
    place.proxy.cut_once(sent=3 * MIB, first=process.kill)
    log, _ = process.communicate(timeout=PATIENCE)
    assert (process.returncode, place.proxy.cuts) == (-9, 1), log
    assert ARCHIVE not in place.names()
    code, log, _ = stored.upload()
    assert code == 0, log
    assert place.names() == {ARCHIVE}
    with tarfile.open(tmp_path / "server" / next(iter(folders(tmp_path))) / ARCHIVE) as tar:
        assert f"{NAME}/hall-2/1/run.json" in tar.getnames()


def folders(tmp_path: Path) -> Iterator[str]:
    return (path.name for path in (tmp_path / "server").iterdir())


def test_a_wrong_password_ends_it_before_anything_is_packed(stored: Stored, place: Place) -> None:
    """And for good: another pod would fare no better."""
    variable = f"ROBOVAST_{place.kind.upper()}_PASSWORD"
    stored.describe({variable: "something wrong"})
    code, log, message = stored.upload()
    assert code == 65
    assert f"{variable}" in message
    assert "packed" not in log
    assert "something wrong" not in log + message


def test_a_secret_with_a_value_that_is_no_text_ends_it_with_its_name(stored: Stored) -> None:
    stored.describe({"KEYSTORE": ""})
    for value in (b"\xff\xfe", b"a\0b"):
        (stored.mounts / "share/KEYSTORE").write_bytes(value)
        code, _, message = stored.upload()
        assert (
            code,
            "KEYSTORE: a value in the Secret of the file share is not text" in message,
        ) == (65, True)


def test_without_a_secret_it_ends_with_what_is_to_be_made(stored: Stored) -> None:
    (stored.mounts / "share").mkdir()
    code, _, message = stored.upload()
    assert code == 65
    assert "the Secret that `spec.share` names is not in the campaign's namespace" in message


@pytest.fixture
def shared_folder(stored: Stored, tmp_path: Path) -> Path:
    """A share of a third party's provider, whose file is in the Secret."""
    (tmp_path / "shared").mkdir()
    variables = {"INNER": str(tmp_path / "shared"), "ROBOVAST_SHARE_TYPE": "own.py:Folder"}
    stored.describe(variables, {"own.py": PROVIDER})
    return tmp_path / "shared"


def test_a_third_partys_provider_gets_the_variables_that_it_asked_for(
    stored: Stored, shared_folder: Path
) -> None:
    """Those of `required_env_vars` need not be in the pod."""
    code, log, _ = stored.upload()
    assert code == 0, log
    assert (shared_folder / ARCHIVE).stat().st_size > 6 * MIB
    stored.describe({"INNER": "broken"})
    code, _, message = stored.upload()
    assert code == 74
    assert f"`folder` cannot take {ARCHIVE}: ValueError: it is broken" in message


def test_results_that_are_not_there_are_told(stored: Stored, shared_folder: Path) -> None:
    stored.store.make_bucket(empty := f"{stored.bucket}-empty")
    try:
        code, _, message = stored.upload(bucket=empty)
    finally:
        stored.store.delete_bucket(empty)
    assert code == 65
    assert "is empty" in message
    code, _, message = stored.upload(bucket=empty)
    assert code == 74
    assert empty in message


def test_a_full_disk_leaves_no_archive(stored: Stored, tmp_path: Path) -> None:
    archive = tmp_path / "full" / ARCHIVE
    with small_disk(2 * MIB), pytest.raises(StorageError, match=r"cannot be written"):
        pack_bucket(stored.store, stored.bucket, NAME, archive)
    assert list(archive.parent.iterdir()) == []


def test_a_run_that_is_not_stored_completely_is_left_out(stored: Stored, tmp_path: Path) -> None:
    stored.store.delete(stored.bucket, ["hall-2/1/run.json"])
    pack_bucket(stored.store, stored.bucket, NAME, tmp_path / ARCHIVE)
    home = import_archive(tmp_path / ARCHIVE, tmp_path / "home")
    assert (home / "hall-2/0/run.json").exists()
    assert not (home / "hall-2/1").exists()
