"""Results brought home from real object stores: complete runs, once, as they were."""

from __future__ import annotations

import io
import json
import tarfile
from pathlib import Path
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server
from support.faults.small_disk import small_disk

from robovast.base.errors import StorageError
from robovast.campaign.imported import MARK, is_imported
from robovast.execution.cluster_config.base import BaseConfig
from robovast.storage.bucket_names import bucket_name
from robovast.storage.download import DownloadResult, download_campaign
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore

RUN = {"_jobs/job-0/logs/system.log": b"log", "_config/a.vast": b"version: 1\n"}


class Meter:
    """Counts what it is told."""

    def __init__(self) -> None:
        self.files = self.size = self.received_bytes = self.finished = 0

    def planned(self, files: int, size: int) -> None:
        self.files, self.size = files, size

    def received(self, size: int) -> None:
        self.received_bytes += size

    def file_finished(self) -> None:
        self.finished += 1


@pytest.fixture
def store(s3_server: Server) -> ObjectStore:
    credentials = Credentials(s3_server.access_key, s3_server.secret_key)
    return ObjectStore(Endpoint.parse(f"http://{s3_server.endpoint}"), credentials, patience=20)


def put_run(store: ObjectStore, bucket: str, path: str, attempt: int = 1, **files: bytes) -> None:
    for name, content in files.items():
        store.put_bytes(bucket, f"{path}/{name}", content)
    record = json.dumps({"job": "job-0", "attempt": attempt})
    store.put_bytes(bucket, f"{path}/run.json", record.encode())


def tree(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink()
    }


def fetch(
    store: ObjectStore, bucket: str, folder: Path, *, force: bool = False
) -> tuple[DownloadResult, Meter]:
    meter = Meter()
    return download_campaign(store, bucket, folder, meter, force=force), meter


def test_a_campaign_comes_home_in_the_local_layout(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    for key, content in RUN.items():
        store.put_bytes(bucket, key, content)
    put_run(store, bucket, "hall-1/0", bag=b"x" * 100_000, test_xml=b"<testsuite/>")
    put_run(store, bucket, "hall-1/1", bag=b"y")
    home = tmp_path / "campaign"
    result, meter = fetch(store, bucket, home)
    assert (result.fetched, result.present, result.unfinished) == (2, 0, ())
    assert set(tree(home)) == {
        *RUN,
        *(f"hall-1/0/{name}" for name in ("bag", "test_xml", "run.json")),
        *(f"hall-1/1/{name}" for name in ("bag", "run.json")),
    }
    assert (home / "hall-1/0/bag").read_bytes() == b"x" * 100_000
    assert (home / "hall-1/0/job/logs/system.log").read_bytes() == b"log"
    assert meter.files == meter.finished == 7
    assert meter.size == meter.received_bytes == result.size


def test_what_is_here_is_not_fetched_again(store: ObjectStore, bucket: str, tmp_path: Path) -> None:
    put_run(store, bucket, "hall/0", bag=b"a")
    store.put_bytes(bucket, "_config/a.vast", b"a")
    fetch(store, bucket, tmp_path)
    put_run(store, bucket, "hall/1", bag=b"b")
    result, meter = fetch(store, bucket, tmp_path)
    assert (result.fetched, result.present) == (1, 1)
    assert meter.files == 2
    result, meter = fetch(store, bucket, tmp_path, force=True)
    assert (result.fetched, meter.files) == (2, 5)


def test_a_run_that_is_not_stored_yet_does_not_appear(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    store.put_bytes(bucket, "hall/0/bag", b"half")
    put_run(store, bucket, "hall/1", bag=b"whole")
    result, _ = fetch(store, bucket, tmp_path)
    assert result.unfinished == ("hall/0",)
    assert sorted(path.name for path in (tmp_path / "hall").iterdir()) == ["1"]


def test_a_repeated_run_replaces_the_one_that_is_here(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    put_run(store, bucket, "hall/0", old=b"old")
    fetch(store, bucket, tmp_path)
    store.delete_bucket(bucket)
    store.make_bucket(bucket)
    put_run(store, bucket, "hall/0", attempt=22, new=b"new")
    result, _ = fetch(store, bucket, tmp_path)
    assert result.fetched == 1
    assert set(tree(tmp_path)) == {"hall/0/new", "hall/0/run.json"}


def test_after_an_interruption_only_the_rest_is_fetched(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    put_run(store, bucket, "hall/0", a=b"a" * 10, b=b"b" * 20)

    class Impatient(Meter):
        def file_finished(self) -> None:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        download_campaign(store, bucket, tmp_path, Impatient(), imported=True)
    assert not (tmp_path / "hall").exists()
    assert is_imported(tmp_path)
    put_run(store, bucket, "hall/0", a=b"a" * 10, b=b"b" * 20)
    result, _ = fetch(store, bucket, tmp_path)
    assert result.fetched == 1
    assert set(tree(tmp_path)) == {MARK, "hall/0/a", "hall/0/b", "hall/0/run.json"}


def test_a_full_disk_is_named_and_what_was_fetched_stays(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    put_run(store, bucket, "hall/0", small=b"a" * 100)
    put_run(store, bucket, "hall/1", big=b"b" * 100_000)
    with (
        small_disk(2**14),
        pytest.raises(StorageError, match=r"(?s)^/.*cannot be written: [^()]+$"),
    ):
        fetch(store, bucket, tmp_path)
    result, _ = fetch(store, bucket, tmp_path)
    assert result.fetched + result.present == 2


def test_a_damaged_object_is_refused(store: ObjectStore, bucket: str, tmp_path: Path) -> None:
    put_run(store, bucket, "hall/0", bag=b"good")
    store._client.put_object(  # what a broken writer or disk would leave
        bucket, "hall/0/bag", io.BytesIO(b"evil"), 4, metadata={"sha256": "0" * 64}
    )
    with pytest.raises(StorageError, match="damaged"):
        fetch(store, bucket, tmp_path)
    assert not (tmp_path / "hall").exists()


def test_keys_that_anybody_chose_are_told_and_the_rest_comes_home(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    put_run(store, bucket, "hall/0", bag=b"x")
    for key in (".download/lock", ".bucket", ".running/lock", ".aside/hall/0/x"):
        store.put_bytes(bucket, key, b"evil")
    result, _ = fetch(store, bucket, tmp_path)
    assert len(result.warnings) == 4
    assert all("is left in the bucket" in line for line in result.warnings)
    assert set(tree(tmp_path)) == {"hall/0/bag", "hall/0/run.json"}
    assert fetch(store, bucket, tmp_path)[0].present == 1


def test_what_stands_in_a_files_way_costs_that_file_alone(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    put_run(store, bucket, "hall/0", bag=b"x")
    put_run(store, bucket, "room/0", bag=b"x")
    store.put_bytes(bucket, "_config/a/b", b"x")
    (tmp_path / "_config").mkdir()
    for place in (tmp_path / "_config/a", tmp_path / "room"):
        place.write_text("mine")
    with pytest.raises(StorageError, match=r"except 2 runs or files.*_config/a/b.*room/0"):
        fetch(store, bucket, tmp_path)
    assert (tmp_path / "hall/0/run.json").exists()
    assert (tmp_path / "room").read_text() == "mine"


def test_two_downloads_into_one_folder_do_not_mix(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    put_run(store, bucket, "hall/0", bag=b"x")

    class Second(Meter):
        def planned(self, files: int, size: int) -> None:
            with pytest.raises(StorageError, match="another download"):
                fetch(store, bucket, tmp_path)

    result = download_campaign(store, bucket, tmp_path, Second())
    assert result.fetched == 1


def test_a_cluster_configuration_packs_a_campaign_into_an_archive(
    store: ObjectStore, s3_server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign = f"Drive-{uuid4().hex[:8]}-2026-01-01-000000"
    store.make_bucket(bucket_name(campaign))
    put_run(store, bucket_name(campaign), "hall/0", bag=b"x")
    monkeypatch.setenv("ROBOVAST_S3_ENDPOINT", f"http://{s3_server.endpoint}")
    monkeypatch.setenv("ROBOVAST_S3_ACCESS_KEY", s3_server.access_key)
    monkeypatch.setenv("ROBOVAST_S3_SECRET_KEY", s3_server.secret_key)
    path = BaseConfig().compress_campaign(campaign, str(tmp_path))
    store.delete_bucket(bucket_name(campaign))
    assert path == str(tmp_path / f"{campaign}.tar.gz")
    with tarfile.open(path) as archive:
        names = {member.name for member in archive.getmembers() if not member.isdir()}
    assert names == {f"{campaign}/hall/0/{name}" for name in ("bag", "job", "run.json")}
