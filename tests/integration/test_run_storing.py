"""A run in the bucket is of one execution or not there, whoever dies, whoever else writes."""

from __future__ import annotations

import itertools
import os
import random
from dataclasses import replace
from pathlib import Path

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.one_run import Execution, Stepper, check_whole, killed_after, open_store
from support.campaigns.owner import OWNER

from robovast.agent.bucket import Bucket
from robovast.agent.check import check_runs
from robovast.base.errors import StorageError
from robovast.campaign.run_files import Writer
from robovast.campaign.verdict import Verdict
from robovast.storage import multipart
from robovast.storage.bucket_runs import listed_files
from robovast.storage.download import Silent, download_campaign
from robovast.storage.s3 import ObjectStore

MIB = 2**20


@pytest.fixture
def store(s3_server: Server) -> ObjectStore:
    return open_store(s3_server)


def check_all(store: ObjectStore, bucket: str, runs: list[str]) -> dict[str, str]:
    """As `finish` does it."""
    of_campaign = Bucket(store, bucket, OWNER)
    return check_runs(of_campaign, {run: of_campaign.seen(run) for run in runs})


def objects(store: ObjectStore, bucket: str, run: str) -> int:
    return len(list(store.objects(bucket, f"{run}/")))


def empty(store: ObjectStore, bucket: str) -> None:
    """Keep what is looked at small."""
    store.delete(bucket, [item.key for item in store.objects(bucket)])


@pytest.mark.parametrize("attempt", [1, 2])
def test_a_writer_may_be_killed_after_any_request(
    s3_server: Server,
    store: ObjectStore,
    bucket: str,
    attempt: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(multipart, "PART", 5 * MIB)
    large = {"bag/large": os.urandom(MIB) * 6, "a/b/c": b"deep"}
    for number in itertools.count():
        run = f"one-1/{number}"
        earlier = []
        if attempt == 2:
            earlier = [Execution(s3_server, bucket, run, "first")]
            earlier[0].storing()
        dying = Execution(s3_server, bucket, run, "dying", attempt, large)
        was_killed = killed_after(dying.store, number, dying.storing)
        seen = check_whole(store, bucket, run, [*earlier, dying])
        assert seen in ([*earlier, dying] if earlier else [None, dying])
        later = Execution(s3_server, bucket, run, "later", attempt)
        later.storing()
        last = dying if seen is dying else later
        assert check_whole(store, bucket, run, [dying, later]) is last
        assert check_all(store, bucket, [run]) == {}
        assert check_whole(store, bucket, run, [last]) is last
        assert objects(store, bucket, run) == len(last.files) + 2, "nothing else is left"
        empty(store, bucket)
        if not was_killed:
            assert seen is dying
            break
    assert number > 8, "so many requests were cut off"


def test_who_removes_leftovers_may_be_killed_after_any_request(
    s3_server: Server, store: ObjectStore, bucket: str
) -> None:
    for number in itertools.count():
        run = f"one-1/{number}"
        first, second = (Execution(s3_server, bucket, run, f"e{n}", n) for n in (1, 2))
        first.storing()
        second.storing()
        assert objects(store, bucket, run) == 5
        dying = open_store(s3_server)
        was_killed = killed_after(dying, number, lambda d=dying, r=run: check_all(d, bucket, [r]))
        assert check_whole(store, bucket, run, [second]) is second
        if not was_killed:
            break
    assert check_all(store, bucket, [f"one-1/{n}" for n in range(number)]) == {}
    assert all(objects(store, bucket, f"one-1/{n}") == 3 for n in range(number))


def test_a_pod_believed_dead_cannot_bring_back_what_was_removed(
    s3_server: Server, store: ObjectStore, bucket: str
) -> None:
    for steps in itertools.count(1):
        run = f"one-1/{steps}"
        first = Execution(s3_server, bucket, run, "first")
        first.storing()
        zombie = Execution(s3_server, bucket, run, "zombie", 2)
        stepper = Stepper([zombie])
        zombie.claim()
        stepper.start()
        went_on = all(stepper.step("zombie") for _ in range(steps))
        assert check_all(store, bucket, [run]) == {}
        assert check_whole(store, bucket, run, [first, zombie]) in (first, zombie)
        assert stepper.finish(["zombie"]) == {"zombie": Verdict.FAILED}
        assert check_whole(store, bucket, run, [zombie]) is zombie
        empty(store, bucket)
        if not went_on:
            break


@pytest.mark.parametrize("attempts", [(1, 1), (2, 2), (1, 2)])
def test_two_writers_in_every_order(
    s3_server: Server, store: ObjectStore, bucket: str, attempts: tuple[int, int]
) -> None:
    """Each sends four requests: look, a file, the list, the record."""
    for number, chosen in enumerate(itertools.combinations(range(8), 4)):
        order = ["a" if place in chosen else "b" for place in range(8)]
        check_order(s3_server, store, bucket, f"one-1/{number}", order, attempts)


@pytest.mark.parametrize("seed", range(3))
def test_three_writers_in_any_order(
    s3_server: Server, store: ObjectStore, bucket: str, seed: int
) -> None:
    chance = random.Random(seed)  # noqa: S311
    for number in range(5):
        order = chance.choices("abc", k=30)
        attempts = tuple(chance.choices((1, 2, 3), k=3))
        check_order(s3_server, store, bucket, f"one-1/{number}", order, attempts, files=3)


def check_order(
    server: Server,
    store: ObjectStore,
    bucket: str,
    run: str,
    order: list[str],
    attempts: tuple[int, ...],
    files: int = 0,
) -> None:
    """Let writers send their requests in an order, and look after each what a reader gets."""
    executions = []
    if min(attempts) > 1:
        executions = [Execution(server, bucket, run, "first")]
        executions[0].storing()
    writers = [
        Execution(server, bucket, run, name, attempt, {f"{name}/{n}": b"x" for n in range(files)})
        for name, attempt in zip("abc", attempts, strict=False)
    ]
    for writer in writers:
        writer.claim()
    executions += writers
    stepper = Stepper(writers)
    stepper.start()
    last = 0
    for name in order:
        stepper.step(name)
        seen = check_whole(store, bucket, run, executions)
        assert seen is not None or min(attempts) == 1
        assert (seen.attempt if seen else 0) >= last, "a later attempt is not taken back"
        last = seen.attempt if seen else 0
    ended = stepper.finish([writer.name for writer in writers])
    assert set(ended.values()) == {Verdict.FAILED}
    final = check_whole(store, bucket, run, executions)
    assert final is not None
    assert final.attempt == max(attempts)
    assert check_all(store, bucket, [run]) == {}
    assert check_whole(store, bucket, run, [final]) is final
    assert objects(store, bucket, run) == len(final.files) + 2
    empty(store, bucket)


def test_every_odd_name_is_listed_and_goes_with_its_bucket(
    s3_server: Server, store: ObjectStore, bucket: str
) -> None:
    """What servers use themselves; the bucket is removed at the end."""
    names = ["a__XLDIR__", "xl.meta", "a/xl.meta", "part.1", ".minio.sys/x", "a\\b", "...", " "]
    run = Execution(s3_server, bucket, "one-1/0", "odd", files=dict.fromkeys(names, b"x"))
    run.storing()
    assert check_whole(store, bucket, "one-1/0", [run]) is run
    assert check_all(store, bucket, ["one-1/0"]) == {}


@pytest.mark.parametrize("path", ["/".join(["d" * 200] * 40), "n" * 300])
def test_what_this_disk_cannot_have_costs_its_run_alone(
    s3_server: Server, store: ObjectStore, bucket: str, tmp_path: Path, path: str
) -> None:
    deep = Execution(s3_server, bucket, "one-1/0", "deep")
    deep.storing()
    Execution(s3_server, bucket, "one-1/1", "plain").storing()
    record, etag = (of_campaign := Bucket(store, bucket, OWNER)).seen("one-1/0")
    assert record is not None
    assert record.files is not None
    [file] = listed_files(store, bucket, "one-1/0", record.files)
    writer = Writer("one-1/0")
    files = of_campaign.store_list(writer, [replace(file, path=path)])
    assert of_campaign.settle("one-1/0", replace(record, files=files), etag)
    with pytest.raises(StorageError, match=r"except 1 runs.*one-1/0.*cannot be kept on this disk"):
        download_campaign(store, bucket, tmp_path, Silent())
    assert (tmp_path / "one-1/1/run.json").exists()
    assert not (tmp_path / "one-1/0").exists()


def test_a_file_of_a_run_beside_a_folder_of_its_name_comes_home(
    s3_server: Server, store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    """As two executions of postprocessing may leave it: first a file, then a folder."""
    Execution(s3_server, bucket, "one-1/0", "plain", files={"b": b"later"}).storing()
    record, etag = (of_campaign := Bucket(store, bucket, OWNER)).seen("one-1/0")
    assert record is not None
    assert record.files is not None
    listed = listed_files(store, bucket, "one-1/0", record.files)
    paths = {"out.csv": "a", "b": "a/b"}
    named = [replace(file, path=paths[file.path]) for file in listed]
    files = of_campaign.store_list(Writer("one-1/0"), named)
    assert of_campaign.settle("one-1/0", replace(record, files=files), etag)
    for present in (0, 1):
        result = download_campaign(store, bucket, tmp_path, Silent())
        assert result.present == present
    assert (tmp_path / "one-1/0/a.1").read_bytes() == b"plain wrote this"
    assert (tmp_path / "one-1/0/a/b").read_bytes() == b"later"


@pytest.mark.parametrize("key", ["../1/run.json", "a" * 2000, "", "a\0b"])
def test_a_record_that_names_no_list_costs_its_run_alone(
    s3_server: Server, store: ObjectStore, bucket: str, tmp_path: Path, key: str
) -> None:
    for number in (0, 1):
        Execution(s3_server, bucket, f"one-1/{number}", "plain").storing()
    of_campaign = Bucket(store, bucket, OWNER)
    record, etag = of_campaign.seen("one-1/0")
    assert record is not None
    assert record.files is not None
    files = replace(record.files, key=key)
    assert of_campaign.settle("one-1/0", replace(record, files=files), etag)
    with pytest.raises(StorageError, match=r"except 1 runs.*one-1/0.*is damaged"):
        download_campaign(store, bucket, tmp_path, Silent())
    assert (tmp_path / "one-1/1/run.json").exists()
    assert set(check_all(store, bucket, ["one-1/0", "one-1/1"])) == {"one-1/0"}


def test_what_is_damaged_costs_its_run_alone(
    s3_server: Server, store: ObjectStore, bucket: str, tmp_path: Path
) -> None:
    for run in ("one-1/0", "one-1/1"):
        Execution(s3_server, bucket, run, "first").storing()
    (key,) = (i.key for i in store.objects(bucket, "one-1/0/") if i.key.endswith("/out.csv"))
    store.delete(bucket, [key])
    damage = check_all(store, bucket, ["one-1/0", "one-1/1"])
    assert damage == {"one-1/0": "1 files are missing, out.csv the first"}
    store.put_bytes(bucket, key, b"other")
    damage = check_all(store, bucket, ["one-1/0", "one-1/1"])
    assert damage == {"one-1/0": "1 files are of another size, out.csv the first"}
    with pytest.raises(StorageError, match=r"except 1 runs.*one-1/0.*is damaged"):
        download_campaign(store, bucket, tmp_path, Silent())
    assert (tmp_path / "one-1/1/out.csv").read_bytes() == b"first wrote this"
    assert not (tmp_path / "one-1/0").exists()
