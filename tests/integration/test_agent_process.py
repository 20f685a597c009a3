"""Results that are worked up where they are stored: real pods, real plugins, a real S3."""

from __future__ import annotations

import contextlib
import itertools
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest
from robovast_testbed.s3 import Server
from support.campaigns.finished import finished_campaign
from support.campaigns.local import make_campaign
from support.campaigns.one_run import killed_after, open_store
from support.campaigns.owner import OWNER
from support.campaigns.stored import write
from support.kube.pod_processes import Campaign, Pod, keys_by_path

from robovast.agent.__main__ import main
from robovast.agent.bucket import Bucket
from robovast.agent.process import CACHE, add_to_run, describe
from robovast.agent.untrusted_files import store_own_tree
from robovast.analysis.postprocessing.events import Failure, Options, PostprocessingSummary
from robovast.analysis.postprocessing.session import postprocess
from robovast.kubeapi.pod_contract.storage_address import ENDPOINT
from robovast.model.packs import CampaignPlan
from robovast.storage.download import Silent, download_campaign
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore

one_server = pytest.mark.parametrize("s3_server", ["minio"], indirect=True)

PLUGINS = '''
import os, signal, time
from pathlib import Path

def each(results_dir, config_dir):
    """A table of the run; a broken one has nothing to make it of."""
    run = Path(results_dir)
    if (run / "broken").exists():
        raise ValueError("nothing to read")
    if (run / "slow").exists():
        os.kill(os.getppid(), signal.SIGTERM)  # as Kubernetes does when the node is drained
        time.sleep(60)
    value = (run / "out.csv").read_text().split()[1]
    (run / "each.csv").write_text(f"score\\n{value}\\n")
    return True, "", [{"output": "each.csv", "sources": ["out.csv"], "plugin": "each"}]

each.per_run = True

def whole(results_dir, config_dir, text):
    (Path(results_dir) / "whole.txt").write_text(text)
    return True, ""
'''
CALLS = "  - tools/plugins.py:each\n  - tools/plugins.py:whole: {text: made}\n"
SCRIPT = '(echo v; echo "$1") > "$3/out.csv"\n'
SECTION = f"  runs_per_job: 3\nresults_processing:\n  postprocessing:\n{CALLS}"


class Quiet:
    """Is told, and tells nobody."""

    def campaign_started(self, campaign: Path, runs: int) -> None: ...
    def step_started(self, title: str, total: int) -> None: ...
    def step_advanced(self) -> None: ...
    def failed(self, failure: Failure) -> None: ...
    def message(self, text: str) -> None: ...
    def campaign_finished(self, summary: PostprocessingSummary) -> None: ...


class Stored:
    """A finished campaign in a bucket of its own, and the mounts of its Jobs."""

    def __init__(self, campaign: Path, mounts: Path, server: Server) -> None:
        self.name = campaign.name
        self.bucket = f"test-{uuid4().hex[:12]}"
        self.mounts = mounts
        self.url = f"http://{server.endpoint}"
        plan = CampaignPlan(
            campaign=self.name,
            bucket=self.bucket,
            owner=OWNER,
            seed=7,
            document="c.vast",
            expansion="pure",
            runs=1,
            image="registry/image:tag",
        )
        write(mounts / "plan/campaign.json", plan.model_dump_json(exclude_none=True))
        write(mounts / "credentials/accessKey", server.access_key)
        write(mounts / "credentials/secretKey", server.secret_key)
        keys = Credentials(server.access_key, server.secret_key)
        self.store = ObjectStore(Endpoint.parse(self.url), keys, patience=60)
        self.store.make_bucket(self.bucket)
        store_own_tree(Bucket(self.store, self.bucket, OWNER), campaign)

    def process(self) -> tuple[int, str]:
        """What a new pod of the Job answers: exit code and termination message."""
        work = self.mounts / f"pod-{uuid4().hex[:8]}"
        message = work / "termination-log"
        write(message, "")
        folders = [f"--{name}={self.mounts / name}" for name in ("plan", "credentials")]
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(ENDPOINT, self.url)
            code = main(["process", *folders, f"--work={work}", f"--message={message}"])
        return code, message.read_text()

    def read(self, path: str) -> str | None:
        key = keys_by_path(self.store, self.bucket).get(path, path)
        content = self.store.read(self.bucket, key)
        return content.decode() if content is not None else None


@pytest.fixture
def stored(tmp_path: Path, s3_server: Server) -> Iterator[Stored]:
    """A campaign of three runs: c-1/0, c-1/1, c-2/0."""
    campaign = finished_campaign(tmp_path / "source", 3, CALLS, PLUGINS)
    made = Stored(campaign, tmp_path / "mounts", s3_server)
    yield made
    made.store.delete_bucket(made.bucket)


@pytest.fixture
def executed(tmp_path: Path, s3_server: Server) -> Iterator[Campaign]:
    """A campaign that pods have executed and finished."""
    vast = make_campaign(
        tmp_path / "source", 'printf "v\\\\n%s\\\\n" "$1" > "$3/out.csv"\n', SECTION
    )
    write(vast.parent / "tools" / "plugins.py", PLUGINS)
    made = Campaign(tmp_path / "mounts", vast, s3_server)
    try:
        pod = Pod(made)
        assert pod.run() == 0, pod.log("agent")
        assert pod.task("finish") == 0, pod.log("finish")
        yield made
    finally:
        made.close()


def versions(campaign: Campaign | Stored) -> dict[str, tuple[str, float]]:
    """What would show that a file, or a run's record, was written again, by path."""
    items = {item.key: item for item in campaign.store.objects(campaign.bucket)}
    keys = keys_by_path(campaign.store, campaign.bucket)
    return {path: (items[key].etag, items[key].modified) for path, key in keys.items()}


def download(campaign: Campaign | Stored, home: Path) -> Path:
    folder = home / campaign.name
    download_campaign(campaign.store, campaign.bucket, folder, Silent())
    return folder


def postprocess_at_home(folder: Path) -> PostprocessingSummary:
    (summary,) = postprocess(folder, Options(jobs=1), Quiet())
    assert not summary.failures
    return summary


@one_server
def test_what_is_worked_up_in_the_cluster_is_finished_at_home(
    executed: Campaign, tmp_path: Path
) -> None:
    raw = versions(executed)
    early = download(executed, tmp_path / "early")
    pod = Pod(executed)
    assert pod.task("process") == 0, pod.log("process")
    message = pod.message()
    assert (message["runs"], message["worked"]) == (3, 3)

    after = versions(executed)
    new = after.keys() - raw.keys()
    made = {f"one-{n}/0/{name}" for n in (1, 2, 3) for name in ("each.csv", "postprocessing.yaml")}
    finished = {"whole.txt", "metadata.yaml", "metadata.prov.json", "campaign.db"}
    tables = {"_execution/data.db", "_execution/tables.duckdb"}
    assert made | finished | tables | {CACHE} <= new
    assert len(new) == message["stored"] + 1, "the files that it says, and the cache"
    assert not any(key.endswith("/lock") or ".download" in key for key in new)
    same = raw.keys() - {f"one-{n}/0/run.json" for n in (1, 2, 3)}
    assert {key: after[key] for key in same} == {key: raw[key] for key in same}

    for folder in (download(executed, tmp_path / "home"), download(executed, tmp_path / "early")):
        before = (folder / "_execution" / "data.db").stat().st_mtime_ns
        summary = postprocess_at_home(folder)
        assert (summary.runs, summary.commands, summary.worked) == (3, 2, set())
        assert (folder / "_execution" / "data.db").stat().st_mtime_ns == before
    assert (early / "one-1/0/each.csv").exists(), "also who had the run before has it whole now"
    with contextlib.closing(sqlite3.connect(early / "_execution" / "data.db")) as connection:
        rows = connection.execute("SELECT config, score FROM each ORDER BY config").fetchall()
    assert rows == [("one-1", 1), ("one-2", 2), ("one-3", 3)]


@one_server
def test_a_second_execution_does_what_is_left(stored: Stored) -> None:
    stored.store.put_bytes(stored.bucket, "c-1/1/broken", b"")
    code, message = stored.process()
    assert code == 65
    assert "each (c-1/1): raised ValueError: nothing to read" in message
    assert "whole" not in message
    assert stored.read("c-1/0/each.csv")
    assert stored.read("whole.txt") == "made"
    assert stored.read("metadata.yaml")
    assert stored.read("c-1/1/each.csv") is None

    stored.store.delete(stored.bucket, ["c-1/1/broken"])
    code, message = stored.process()
    assert code == 0
    assert stored.read("c-1/1/each.csv") == "score\n1\n"

    before = versions(stored)
    assert stored.process() == (0, '{"runs": 3, "worked": 0, "stored": 0}')
    assert versions(stored) == before, "nothing was to be done, nothing was written"


@one_server
def test_an_execution_that_was_lost_while_it_stored_is_made_up_for(stored: Stored) -> None:
    assert stored.process()[0] == 0
    lost = ["_execution/tables.duckdb", "whole.txt", CACHE]
    stored.store.delete(stored.bucket, lost)
    assert stored.process()[0] == 0
    assert set(lost) <= versions(stored).keys()


@one_server
def test_it_may_be_killed_after_any_request_that_adds_to_a_run(
    stored: Stored, s3_server: Server, tmp_path: Path
) -> None:
    home = download(stored, tmp_path)
    before = run_files(stored, tmp_path / "before")
    (home / "c-1/0/new.csv").write_text("new")
    (home / "c-1/0/out.csv").write_text("changed")
    names = ["c-1/0/new.csv", "c-1/0/out.csv"]
    after = {**before, "c-1/0/new.csv": b"new", "c-1/0/out.csv": b"changed"}
    for number in itertools.count():
        store = open_store(s3_server)
        bucket = Bucket(store, stored.bucket, OWNER)
        was_killed = killed_after(
            store, number, lambda b=bucket: add_to_run(b, home, "c-1/0", names)
        )
        found = run_files(stored, tmp_path / f"after-{number}")
        assert found in (before, after), "all of it or nothing"
        if not was_killed:
            assert found == after
            break
    assert number > 3
    assert add_to_run(bucket, home, "c-1/0", names) == 0, "the run is another one since"


FOLDERS = """
from pathlib import Path

def each(results_dir, config_dir):
    made = Path(results_dir) / "each.csv"
    made.unlink()
    made.mkdir()
    (made / "new").write_text("new")
    return True, ""

each.per_run = True

def whole(results_dir, config_dir, text):
    made = Path(results_dir) / "whole.txt"
    made.unlink()
    made.mkdir()
    (made / "new").write_text("new")
    return True, ""
"""


def test_a_folder_in_place_of_a_file_of_before_loses_neither(
    stored: Stored, tmp_path: Path
) -> None:
    assert stored.process()[0] == 0
    stored.store.put_bytes(stored.bucket, "_config/tools/plugins.py", FOLDERS.encode())
    code, message = stored.process()
    home = download(stored, tmp_path)
    assert (home / "c-1/0/each.csv/new").read_text() == "new"
    assert (home / "c-1/0/each.csv.1").read_text() == "score\n0\n"
    assert code == 0, message
    assert (home / "whole.txt.1/new").read_text() == "new"
    assert (home / "whole.txt").read_text() == "made"


def run_files(stored: Stored, home: Path) -> dict[str, bytes]:
    folder = download(stored, home)
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in (folder / "c-1/0").rglob("*")
        if path.is_file() and path.name != "run.json" and not path.is_symlink()
    }


@one_server
def test_a_pod_that_is_told_to_end_leaves_the_work_to_the_next(stored: Stored) -> None:
    stored.store.put_bytes(stored.bucket, "c-1/1/slow", b"")
    before = versions(stored)
    assert stored.process()[0] == 75
    assert versions(stored) == before


@one_server
def test_without_storage_it_says_so_and_may_be_tried_again(stored: Stored) -> None:
    stored.store.delete_bucket(stored.bucket)
    code, message = stored.process()
    assert code == 74
    assert stored.bucket in message


def test_what_fails_for_one_reason_is_told_once() -> None:
    reason = "reading ROS bags needs the extra `ros`"
    commands = ("rosbags_tf_to_csv", "rosbags_to_csv")
    failures = [Failure("hall", name, f"hall-1/{n}", reason) for n in range(9) for name in commands]
    failures += [Failure("hall", "metrics", f"hall-1/{n}", f"run {n} is odd") for n in range(9)]
    assert describe(failures).splitlines()[1:] == [
        f"rosbags_tf_to_csv, rosbags_to_csv (hall-1/0 and 8 more): {reason}",
        *(f"metrics (hall-1/{n}): run {n} is odd" for n in range(4)),
        "… and 5 more reasons.",
    ]
