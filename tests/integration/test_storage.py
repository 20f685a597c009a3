"""The object store against real servers of two makes, which are killed, cut off and lied to."""

from __future__ import annotations

import hashlib
import io
import os
import threading
import time
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4

import minio
import pytest
from minio import Minio
from robovast_testbed import clocks, outages
from robovast_testbed.s3 import Server
from support.patience import PATIENCE
from support.servers.cutting_proxy import cutting_proxy

from robovast.base.errors import StorageError
from robovast.storage import multipart, s3_errors
from robovast.storage import s3 as storage
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.multipart import PART, Content
from robovast.storage.s3 import ObjectStore, StoredObject
from robovast.storage.s3_errors import ObjectError

MIB = 2**20


def open_store(
    server: Server, address: str | None = None, patience: float = PATIENCE
) -> ObjectStore:
    credentials = Credentials(server.access_key, server.secret_key)
    endpoint = Endpoint.parse(f"http://{address or server.endpoint}")
    return ObjectStore(endpoint, credentials, patience=patience)


@pytest.fixture
def store(s3_server: Server) -> ObjectStore:
    return open_store(s3_server)


@pytest.fixture
def plain(s3_server: Server) -> Minio:
    keys = {"access_key": s3_server.access_key, "secret_key": s3_server.secret_key}
    return Minio(s3_server.endpoint, secure=False, **keys)


def some_file(path: Path, size: int) -> Path:
    path.write_bytes(os.urandom(min(size, MIB)) * -(-size // MIB))
    os.truncate(path, size)
    return path


def fetch(store: ObjectStore, bucket: str, key: str, target: Path) -> Path:
    (item,) = (item for item in store.objects(bucket, key) if item.key == key)
    store.get_file(bucket, item, target)
    return target


def while_running(action: Callable[[], object], disturb: Callable[[], None]) -> None:
    """Disturb an action in its middle, then wait for it."""
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(action)
        time.sleep(0.15)
        disturb()
        future.result(timeout=2 * PATIENCE)


@pytest.mark.parametrize("size", [0, 1, 5000, PART, 2 * PART + 1])
def test_a_file_comes_home_as_it_was(
    store: ObjectStore, bucket: str, tmp_path: Path, size: int
) -> None:
    source = some_file(tmp_path / "source", size)
    assert store.put_file(bucket, "a/b c/ü.bin", source)
    target = fetch(store, bucket, "a/b c/ü.bin", tmp_path / "home" / "ü.bin")
    assert target.read_bytes() == source.read_bytes()
    assert [path.name for path in target.parent.iterdir()] == ["ü.bin"]


def test_an_object_that_should_be_small_and_is_not_is_not_read(
    store: ObjectStore, bucket: str
) -> None:
    store.put_bytes(bucket, "owner", b"x" * 100)
    assert store.read(bucket, "owner", 100) == b"x" * 100
    with pytest.raises(ObjectError, match=f"{bucket}/owner has 100 bytes, more than the 99"):
        store.read(bucket, "owner", 99)


def test_what_is_there_and_equal_is_not_sent_again(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    source = some_file(tmp_path / "source", 3000)
    assert store.put_file(bucket, "key", source)
    assert not store.put_file(bucket, "key", source)
    some_file(source, 3001)
    assert store.put_file(bucket, "key", source)


def changes_after_measuring(
    monkeypatch: pytest.MonkeyPatch, change: Callable[[], object], times: int = 99
) -> None:
    """Let a file change between its measuring and its sending."""
    left = [times]

    def measure(file: BinaryIO) -> Content:
        content = multipart.measured(file)
        if left[0]:
            left[0] -= 1
            change()
        return content

    monkeypatch.setattr(storage, "measured", measure)


@pytest.mark.parametrize("size", [2 * MIB, 2 * PART + 1])
@pytest.mark.parametrize("shrink", [False, True])
def test_a_file_that_changes_while_it_is_sent_is_sent_anew(
    store: ObjectStore,
    bucket: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    size: int,
    shrink: bool,
) -> None:
    source = some_file(tmp_path / "source", size)
    after = b"x" * (size - 1000 if shrink else size)
    changes_after_measuring(monkeypatch, lambda: source.write_bytes(after), times=1)
    begin = time.monotonic()
    with source.open("rb") as file:
        assert store.put_new(bucket, "key", file).sha256 == hashlib.sha256(after).hexdigest()
    assert time.monotonic() - begin < PATIENCE / 2, "it is not waited for"
    assert fetch(store, bucket, "key", tmp_path / "target").read_bytes() == after


def test_a_file_that_changes_again_and_again_is_the_files_fault(
    store: ObjectStore, bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = some_file(tmp_path / "source", 2 * MIB)
    changes_after_measuring(monkeypatch, lambda: some_file(source, 2 * MIB))
    with pytest.raises(OSError, match="keeps changing"):
        store.put_file(bucket, "key", source)
    assert list(store.objects(bucket)) == []


def test_parts_grow_with_the_file_and_memory_does_not(
    store: ObjectStore, bucket: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(multipart, "MOST_PARTS", 2)
    size = 6 * PART
    assert [end - begin for begin, end in multipart.stretches(size)] == [3 * PART, 3 * PART]
    source = some_file(tmp_path / "source", size)
    tracemalloc.start()
    try:
        store.put_file(bucket, "key", source)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 16 * MIB
    assert fetch(store, bucket, "key", tmp_path / "target").read_bytes() == source.read_bytes()


def test_an_object_that_lost_its_end_is_replaced(
    store: ObjectStore, bucket: str, plain: Minio, tmp_path: Path
) -> None:
    source = some_file(tmp_path / "source", 3000)
    plain.put_object(bucket, "key", io.BytesIO(source.read_bytes()[:1000]), 1000)
    assert store.put_file(bucket, "key", source)
    assert store.read(bucket, "key") == source.read_bytes()


def test_executables_stay_executable(store: ObjectStore, bucket: str, tmp_path: Path) -> None:
    source = some_file(tmp_path / "source", 10)
    source.chmod(0o755)
    store.put_file(bucket, "tool", source)
    assert os.access(fetch(store, bucket, "tool", tmp_path / "tool"), os.X_OK)


def test_an_upload_survives_a_server_that_is_killed_and_restarted(
    s3_server: Server, store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    source = some_file(tmp_path / "source", 12 * PART)

    def restart() -> None:
        s3_server.stop()
        time.sleep(1)
        s3_server.start()

    while_running(lambda: store.put_file(bucket, "large", source), restart)
    target = fetch(store, bucket, "large", tmp_path / "target")
    assert (
        hashlib.sha256(target.read_bytes()).digest() == hashlib.sha256(source.read_bytes()).digest()
    )


def test_a_cut_upload_leaves_nothing_and_is_repeated(
    s3_server: Server, bucket: str, tmp_path: Path
) -> None:
    source = some_file(tmp_path / "source", 4 * MIB)
    with cutting_proxy(s3_server.endpoint) as proxy:
        impatient = open_store(s3_server, proxy.address, patience=0)
        proxy.cut_once(sent=2 * MIB)
        with pytest.raises(StorageError, match="cannot store"):
            impatient.put_file(bucket, "key", source)
        assert list(impatient.objects(bucket)) == []

        proxy.cut_once(sent=2 * MIB)
        assert open_store(s3_server, proxy.address).put_file(bucket, "key", source)
        assert proxy.cuts == 2
        assert impatient.read(bucket, "key") == source.read_bytes()


def test_a_download_goes_on_where_it_was_cut(
    s3_server: Server, store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    source = some_file(tmp_path / "source", 8 * MIB)
    store.put_file(bucket, "key", source)
    (item,) = store.objects(bucket)
    arrived: list[int] = []
    with cutting_proxy(s3_server.endpoint) as proxy:
        proxy.cut_once(received=6 * MIB)
        impatient = open_store(s3_server, proxy.address, patience=0)
        with pytest.raises(StorageError, match="cannot fetch"):
            impatient.get_file(bucket, item, tmp_path / "target", arrived.append)
        before = sum(arrived)
        assert before >= 4 * MIB
        proxy.cut_once(received=before)  # there is less left, so nothing is cut
        impatient.get_file(bucket, item, tmp_path / "target")
        assert proxy.cuts == 1
    assert (tmp_path / "target").read_bytes() == source.read_bytes()


def test_a_damaged_object_is_refused_by_name(
    store: ObjectStore, bucket: str, plain: Minio, tmp_path: Path
) -> None:
    lie = {"sha256": hashlib.sha256(b"what was meant").hexdigest()}
    plain.put_object(bucket, "key", io.BytesIO(b"what is there"), 13, metadata=lie)
    with pytest.raises(StorageError, match=f"{bucket}/key is damaged"):
        fetch(store, bucket, "key", tmp_path / "target")
    with pytest.raises(StorageError, match=f"{bucket}/key is damaged"):
        store.read(bucket, "key")
    assert list(tmp_path.iterdir()) == []


def test_of_several_writers_one_creates_an_object(store: ObjectStore, bucket: str) -> None:
    contents = [f"writer {number}".encode() for number in range(8)]
    with ThreadPoolExecutor(8) as pool:
        won = list(pool.map(lambda content: store.create(bucket, "run.json", content), contents))
    assert won.count(True) == 1
    assert store.read(bucket, "run.json") == contents[won.index(True)]
    assert store.create(bucket, "run.json", contents[won.index(True)]), "its own is no other's"


def test_of_several_writers_one_replaces_what_all_have_seen(
    store: ObjectStore, bucket: str
) -> None:
    store.put_bytes(bucket, "run.json", b"first")
    look = store.look(bucket, "run.json")
    assert look is not None
    etag = look.etag
    contents = [f"writer {number}".encode() for number in range(8)]
    won = [store.replace(bucket, "run.json", content, etag) for content in contents]
    assert won == [True] + 7 * [False]
    assert store.read(bucket, "run.json") == contents[0]
    assert store.replace(bucket, "run.json", contents[0], etag), "its own is no other's"
    assert not store.replace(bucket, "nothing", b"x", etag)


def test_an_object_is_refused_that_is_not_what_a_list_says(
    store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    store.put_bytes(bucket, "key", b"content")
    digest = hashlib.sha256(b"content").hexdigest()
    begin = time.monotonic()
    for size, sha256 in ((6, digest), (8, digest), (7, "0" * 64)):
        with pytest.raises(ObjectError, match=f"{bucket}/key is damaged"):
            store.get_file(bucket, StoredObject("key", size, 0, "", sha256), tmp_path / "target")
    with pytest.raises(ObjectError, match="NoSuchKey"):
        store.get_file(bucket, StoredObject("gone", 7, 0, "", digest), tmp_path / "target")
    assert time.monotonic() - begin < PATIENCE / 2, "what will not change is not waited for"
    assert list(tmp_path.iterdir()) == []
    store.get_file(bucket, StoredObject("key", 7, 0, "", digest), tmp_path / "target")


def test_names_of_85_chinese_characters(store: ObjectStore, bucket: str, tmp_path: Path) -> None:
    for name in ("名" * 85, "名" * 84 + "字"):
        source = some_file(tmp_path / "source", 10)
        store.put_file(bucket, f"a/{name}", source)
        target = fetch(store, bucket, f"a/{name}", tmp_path / "home" / name)
        assert target.read_bytes() == source.read_bytes()


def test_a_thousand_small_objects(store: ObjectStore, bucket: str) -> None:
    keys = [f"variant-{number % 10}/{number}/test.xml" for number in range(1000)]
    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(lambda key: store.put_bytes(bucket, key, key.encode()), keys))
    assert [item.key for item in store.objects(bucket)] == sorted(keys)
    assert len(list(store.objects(bucket, "variant-1/"))) == 100
    assert store.folders(bucket) == [f"variant-{number}" for number in range(10)]
    assert len(store.folders(bucket, "variant-3/")) == 100


def test_a_listing_survives_a_restart(s3_server: Server, store: ObjectStore, bucket: str) -> None:
    for number in range(3):
        store.put_bytes(bucket, f"key-{number}", b"content")
    s3_server.stop()
    threading.Timer(0.5, s3_server.start).start()
    assert len(list(store.objects(bucket))) == 3


def test_buckets_are_made_once_and_removed_with_their_content(store: ObjectStore) -> None:
    name = f"test-{uuid4().hex[:12]}"
    store.make_bucket(name)
    store.make_bucket(name)
    store.put_bytes(name, "a/b", b"content")
    assert name in store.buckets()
    store.delete_bucket(name)
    store.delete_bucket(name)
    assert name not in store.buckets()


def test_what_is_not_there_is_none(store: ObjectStore, bucket: str) -> None:
    assert store.read(bucket, "nothing") is None
    assert store.digest(bucket, "nothing") is None
    assert store.read(f"{bucket}-nothing", "nothing") is None


def test_a_wrong_key_is_said_at_once(s3_server: Server, bucket: str) -> None:
    endpoint = Endpoint.parse(f"http://{s3_server.endpoint}")
    stranger = ObjectStore(endpoint, Credentials(s3_server.access_key, "wrong"), patience=PATIENCE)
    begin = time.monotonic()
    with pytest.raises(StorageError, match=r"Check the secret key|policy"):
        stranger.put_bytes(bucket, "key", b"")
    assert time.monotonic() - begin < PATIENCE / 2


@pytest.mark.parametrize("seconds", [3600, -3600])
def test_a_wrong_clock_is_named_and_waited_for(
    s3_server: Server,
    bucket: str,
    seconds: int,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(s3_errors, "REPORTED_AFTER", 0.0)
    (process,) = outages.processes(s3_server.bed, lambda words: s3_server.make in words[0])
    patient, hasty = open_store(s3_server), open_store(s3_server, patience=1)
    with ThreadPoolExecutor() as pool:
        with clocks.shifted(process, seconds):
            time.sleep(3)  # servers look at the clock for the header Date once a second
            with pytest.raises(StorageError, match=r"clock"):
                hasty.put_bytes(bucket, "key", b"")
            stored = pool.submit(patient.put_bytes, bucket, "key", b"content")
            time.sleep(1)
            assert not stored.done()
        stored.result()
    assert hasty.read(bucket, "key") == b"content"
    reports = [text for text in caplog.messages if text.startswith("S3 is tried again")]
    assert len(reports) == 2, "each store reports once"
    assert all("clock" in text for text in reports)


def test_a_clock_that_was_corrected_meanwhile_denies_nothing(
    s3_server: Server, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A request is signed an hour late; when its answer comes, the clock is right again."""
    store = open_store(s3_server)
    store.put_bytes(bucket, "key", b"content")
    utcnow = minio.time.utcnow
    wrong = iter([timedelta(hours=1)])
    monkeypatch.setattr(minio.time, "utcnow", lambda: utcnow() + next(wrong, timedelta()))
    assert store.digest(bucket, "key") is not None
    assert next(wrong, None) is None, "a request was signed with the wrong time"


def test_a_server_that_stays_away_is_named_when_patience_ends(s3_server: Server) -> None:
    gone = open_store(s3_server, "127.0.0.1:1", patience=1)
    with pytest.raises(StorageError, match=r"http://127\.0\.0\.1:1: cannot list buckets"):
        gone.buckets()


def test_credentials_come_from_the_files_of_a_secret(tmp_path: Path) -> None:
    (tmp_path / "accessKey").write_text("me\n")
    with pytest.raises(StorageError, match=r"secretKey.*has the keys"):
        Credentials.from_folder(tmp_path)
    (tmp_path / "secretKey").write_text("")
    with pytest.raises(StorageError, match="is empty"):
        Credentials.from_folder(tmp_path)
    (tmp_path / "secretKey").write_text("hidden")
    credentials = Credentials.from_folder(tmp_path)
    assert (credentials.access_key, credentials.secret_key) == ("me", "hidden")
    assert "hidden" not in repr(credentials)


def test_keys_of_another_server_are_named_with_the_secret_that_has_them(
    s3_server: Server, bucket: str
) -> None:
    keys = Credentials("another-server", "secret-of-another-server")
    store = ObjectStore(Endpoint.parse(f"http://{s3_server.endpoint}"), keys, patience=1)
    with pytest.raises(
        StorageError, match=r"keys are outdated or belong to another server.*robovast-storage"
    ):
        list(store.objects(bucket))
