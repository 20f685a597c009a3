"""Questions about campaigns that stay in their bucket: the same answers, of a real S3 server."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.finished import finished_campaign
from support.campaigns.one_run import open_store
from support.campaigns.owner import OWNER

from robovast.agent.bucket import Bucket
from robovast.agent.untrusted_files import store_own_tree
from robovast.analysis.postprocessing.events import Options
from robovast.analysis.postprocessing.session import postprocess
from robovast.analysis.tables.columnar import write_runs
from robovast.analysis.tables.in_bucket import tables_in
from robovast.analysis.tables.query import ask
from robovast.analysis.tables.runs import record_rows
from robovast.analysis.tables.stored import StoredTables
from robovast.base.errors import ExitCode, InputError, StorageError
from robovast.campaign.layout import COLUMNAR_TABLES, INDEX, RUNS_TABLE, Layout
from robovast.campaign.run_record import read_run_record
from robovast.storage.s3 import ObjectStore
from robovast_cli.main import command

pytestmark = pytest.mark.parametrize("s3_server", ["minio", "versitygw"], indirect=True)

ALL_RUNS = "SELECT * EXCLUDE (out_v) FROM runs ORDER BY id"
OUTPUT = "SELECT config, sum(v) AS v FROM out GROUP BY config ORDER BY config"


class Quiet:
    """Is told, and tells nobody."""

    def __getattr__(self, _: str) -> object:
        return lambda *_: None


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A campaign of 5 runs with tables and a graph, and an index that is older than these."""
    folder = finished_campaign(tmp_path / "results", 5)
    (summary,) = postprocess(folder, Options(), Quiet())  # type: ignore[arg-type]
    assert not summary.failures
    return folder


@pytest.fixture
def store(s3_server: Server) -> ObjectStore:
    return open_store(s3_server)


@pytest.fixture
def bucket(store: ObjectStore) -> Iterator[str]:
    name = f"test-{uuid4().hex[:12]}"
    store.make_bucket(name)
    yield name
    store.delete_bucket(name)


def write_index(store: ObjectStore, bucket: str, campaign: Path) -> None:
    records = [read_run_record(folder) for folder in Layout(campaign).run_folders()]
    keys = ("id", "variant", "run", "verdict", "reason", "attempt", "started_at", "duration", "job")
    runs = [{key: getattr(record, key) for key in keys} for record in records]
    missing = {"id": 9, "variant": "c-9", "run": 0, "verdict": "errored", "attempt": 0}
    text = json.dumps({"campaign": campaign.name, "runs": [*runs, missing]})
    store.put_bytes(bucket, INDEX, text.encode())


def test_answers_are_those_of_a_download(
    store: ObjectStore, bucket: str, campaign: Path, tmp_path: Path
) -> None:
    write_index(store, bucket, campaign)
    store_own_tree(Bucket(store, bucket, OWNER), campaign)
    tables = tables_in(store, bucket, campaign.name)
    for question in (ALL_RUNS, OUTPUT):
        assert ask([tables], question) == ask([campaign], question)


def test_tables_older_than_the_last_runs_are_not_asked(
    store: ObjectStore, bucket: str, campaign: Path, tmp_path: Path
) -> None:
    """Until results are processed again there are the rows of the runs, as their end left them."""
    store.put_file(bucket, COLUMNAR_TABLES, campaign / COLUMNAR_TABLES)
    later = store.find(bucket, COLUMNAR_TABLES)
    assert later is not None
    while (index := store.find(bucket, INDEX)) is None or index.modified <= later.modified:
        store.delete(bucket, [INDEX])
        write_index(store, bucket, campaign)
    records = [read_run_record(folder) for folder in Layout(campaign).run_folders()]
    write_runs(tmp_path / "runs.duckdb", list(record_rows([r for r in records if r is not None])))
    store.put_file(bucket, RUNS_TABLE, tmp_path / "runs.duckdb")
    tables = tables_in(store, bucket, campaign.name)
    assert ask([tables], "FROM runs ORDER BY id").rows == ask([campaign], ALL_RUNS).rows
    with pytest.raises(InputError, match="out"):
        ask([tables], OUTPUT)


def test_before_the_end_there_are_no_tables(
    store: ObjectStore, bucket: str, campaign: Path
) -> None:
    for _ in range(2):
        with pytest.raises(InputError, match="contains no tables yet"):
            tables_in(store, bucket, campaign.name)
        write_index(store, bucket, campaign)


def test_tables_that_are_replaced_meanwhile_are_no_wrong_query(
    store: ObjectStore, bucket: str, campaign: Path, tmp_path: Path
) -> None:
    store.put_file(bucket, COLUMNAR_TABLES, campaign / COLUMNAR_TABLES)
    tables = tables_in(store, bucket, campaign.name)
    assert isinstance(tables, StoredTables)
    store.put_bytes(bucket, COLUMNAR_TABLES, b"something else")
    with pytest.raises(StorageError, match="changed"):
        ask([tables], OUTPUT)
    with pytest.raises(StorageError, match="cannot be read"):
        ask([StoredTables("damaged", 8192, lambda *_: b"x" * 4096)], OUTPUT)


def name_storage(s3_server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    """Name the S3 server and its keys in the environment."""
    monkeypatch.setenv("ROBOVAST_S3_ENDPOINT", f"http://{s3_server.endpoint}")
    monkeypatch.setenv("ROBOVAST_S3_ACCESS_KEY", s3_server.access_key)
    monkeypatch.setenv("ROBOVAST_S3_SECRET_KEY", s3_server.secret_key)


def test_a_bucket_without_a_graph_says_who_makes_it(
    store: ObjectStore,
    bucket: str,
    campaign: Path,
    s3_server: Server,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write_index(store, bucket, campaign)
    name_storage(s3_server, monkeypatch)
    with pytest.raises(SystemExit) as ended:
        command().main(
            args=["results", "sparql", "failed-runs", "--bucket", bucket], prog_name="vast"
        )
    assert ended.value.code == ExitCode.BAD_INPUT
    said = capsys.readouterr().err
    assert f"no graph is stored for {bucket}" in said
    assert "spec.processResults: true" in said
    assert "/tmp" not in said, "the folder of this command, which is gone"


def test_commands_answer_as_after_a_download(
    store: ObjectStore,
    bucket: str,
    campaign: Path,
    s3_server: Server,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    store_own_tree(Bucket(store, bucket, OWNER), campaign)
    name_storage(s3_server, monkeypatch)

    def said(*words: str) -> str:
        with pytest.raises(SystemExit) as ended:
            command().main(args=["results", *words], prog_name="vast")
        captured = capsys.readouterr()
        assert not ended.value.code, captured.err
        return captured.out

    here, there = ("-r", str(campaign.parent)), ("--bucket", bucket)
    for words in (("query", OUTPUT), ("query", ALL_RUNS, "-o", "csv"), ("query",)):
        assert said(*words, *there).replace(bucket, campaign.name) == said(*words, *here)
    assert said("sparql", "test-results", *there) == said("sparql", "test-results", *here)
    own = json.loads(said("summary", campaign.name, *here, "-o", "json"))
    other = json.loads(said("summary", *there, "-o", "json"))
    assert own.pop("next") == other.pop("next") == ""
    assert (own.pop("campaign"), other.pop("campaign")) == (campaign.name, bucket)
    assert other == own
