"""Logs of running jobs are stored as they grow, and never delay the result of a run."""

from __future__ import annotations

import os
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.campaigns.owner import OWNER
from support.patience import eventually

from robovast.agent import agent as agent_module
from robovast.agent import results as results_module
from robovast.agent.agent import _Keeper
from robovast.agent.background import Background
from robovast.agent.bucket import Bucket
from robovast.agent.pack import Pack, PodStart
from robovast.agent.results import MOST_FILES, ROOM, PodResults
from robovast.campaign.records import EndedRun
from robovast.campaign.verdict import TestResult, Verdict
from robovast.model.expansion import Variant
from robovast.model.plan import Run
from robovast.model.scenario import Scenario
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore

SMALL_BUFFER = (socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
LOG = "_jobs/job-0/logs/system.log"
RUN = Run(0, Variant("hall-1", "hall", {}), 0)
PACK = Pack(
    campaign="test",
    bucket="test",
    owner=OWNER,
    image="",
    number=0,
    attempt=1,
    runs=(RUN,),
    done={},
    first_job=1,
    scenario=Scenario("test", ()),
    timeout=None,
    secondaries=(),
    environment={},
)


class Link:
    """An S3 server behind a link of limited rate, which all uploads share."""

    def __init__(self, rate: float = float("inf")) -> None:
        """Set the rate [byte/s]."""
        self.objects: dict[str, bytes] = {}
        self.stored: list[tuple[str, float]] = []
        """Keys, and when each object was complete [s]."""
        self.received = 0
        """[byte]"""
        self._rate = rate
        self._free = 0.0
        self._lock = threading.Lock()

    def pass_on(self, size: int) -> None:
        """Take a part of an upload, as fast as the link does."""
        with self._lock:
            self.received += size
            self._free = max(self._free, time.monotonic()) + size / self._rate
            wait = self._free - time.monotonic()
        time.sleep(max(0.0, wait))

    def at(self, key: str) -> float | None:
        """When an object was complete [s]."""
        return next((at for name, at in self.stored if name == key), None)


@contextmanager
def served(link: Link) -> Iterator[str]:
    """The address of the server."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        rbufsize = 0

        def do_PUT(self) -> None:
            left, parts = int(self.headers["Content-Length"]), []
            while left:
                part = self.rfile.read(min(left, 16384))
                if not part:
                    self.close_connection = True
                    return
                link.pass_on(len(part))
                parts.append(part)
                left -= len(part)
            key = self.path.removeprefix("/test/")
            link.objects[key] = b"".join(parts)
            link.stored.append((key, time.monotonic()))
            self._answer(200)

        def do_GET(self) -> None:
            if "list-type" in self.path:
                self._answer(200, b"<ListBucketResult><Name>test</Name></ListBucketResult>")
                return
            self._answer(404, b"<Error><Code>NoSuchKey</Code></Error>")

        def do_HEAD(self) -> None:
            self._answer(404)

        def _answer(self, status: int, body: bytes = b"") -> None:
            self.send_response(status)
            self.send_header("ETag", '"1"')
            self.send_header("Content-Type", "application/xml")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    server.socket.setsockopt(*SMALL_BUFFER)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


@contextmanager
def pod(link: Link, out: Path) -> Iterator[tuple[_Keeper, PodResults, PodStart]]:
    """What stores the output of a pod that executes one job."""
    folder = out / "_jobs" / "job-0" / "logs"
    folder.mkdir(parents=True)
    with ExitStack() as stack:
        endpoint = Endpoint.parse(stack.enter_context(served(link)), "us-east-1")
        background = stack.enter_context(Background())
        keys = Credentials("key", "secret")
        store = ObjectStore(endpoint, keys, patience=30)
        yielding = ObjectStore(endpoint, keys, patience=0, stopped=background.is_busy)
        results = PodResults(Bucket(store, "test", OWNER), PACK, "pod", yielding)
        folders: Any = SimpleNamespace(out=out)
        keeper = _Keeper(folders, results, background, {}, [], [])
        yield keeper, results, PACK.job(1, (RUN,))


def ended(job: PodStart, folder: Path) -> EndedRun:
    folder.mkdir()
    (folder / "out.csv").write_bytes(os.urandom(100_000))
    return EndedRun(job, RUN, folder, TestResult(Verdict.PASSED), (1e9, 1e9 + 1), None)


def test_a_run_is_stored_within_seconds_of_its_end_on_a_slow_link(tmp_path: Path) -> None:
    """A log of 14.4 MB takes 38 s on this link; it is being sent when the run ends."""
    link = Link(rate=3e6 / 8)
    with pod(link, tmp_path) as (keeper, _, job):
        own = tmp_path / "_jobs" / "job-0"
        (own / "logs" / "system.log").write_bytes(os.urandom(14_400_000))
        keeper._next_snapshot = 0.0
        keeper.goes_on(job)
        eventually(lambda: link.received > 500_000)
        over = time.monotonic()
        run = ended(job, tmp_path / "run")
        keeper.job_over(job, own, run)
        eventually(lambda: link.at("hall-1/0/run.json") is not None)
        at = link.at("hall-1/0/run.json")
        assert at is not None
        assert at - over < 5
        assert LOG not in link.objects, "the part of the log was not stored as a log"
        assert link.received < 3_000_000
        link._rate = float("inf")
    assert len(link.objects[LOG]) == 14_400_000


def test_one_snapshot_is_stored_at_a_time_and_the_next_one_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(agent_module, "SNAPSHOT_INTERVAL", 0.1)
    begun, running = [], threading.Lock()

    class Slow:
        def store_logs(self, *_: object) -> None:
            assert running.acquire(blocking=False), "two at once"
            begun.append(time.monotonic())
            time.sleep(0.3)
            running.release()

    (tmp_path / "_jobs" / "job-0").mkdir(parents=True)
    slow, folders, job = Slow(), SimpleNamespace(out=tmp_path), SimpleNamespace(name="job-0")
    with Background() as background:
        keeper = _Keeper(folders, slow, background, {}, [], [])  # type: ignore[arg-type]
        while len(begun) < 4:
            keeper.goes_on(job)  # type: ignore[arg-type]
            time.sleep(0.005)
    assert all(later - earlier >= 0.4 for earlier, later in pairwise(begun))


FILES = st.dictionaries(
    st.sampled_from(["logs/system.log", "logs/a.log", "logs/b/c.log", "sysinfo.yaml", "huge.bin"]),
    st.sampled_from([0, 1, 1000, ROOM - 1, ROOM, ROOM + 1, 2 * ROOM]),
)


class Kept:
    """Keeps what a snapshot stores."""

    def __init__(self) -> None:
        self.objects: dict[str, bytes] = {}

    def put_new(self, _: str, key: str, file: Any) -> None:
        self.objects[key] = os.pread(file.fileno(), 3 * ROOM, 0)

    def put_bytes(self, _: str, key: str, content: bytes) -> None:
        self.objects[key] = content


@settings(max_examples=25, deadline=None)
@given(FILES, FILES)
def test_a_snapshot_is_bounded_and_stores_only_what_has_changed(
    first: dict[str, int], then: dict[str, int]
) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name, "job-0")
        folder.mkdir()
        kept, bucket = Kept(), SimpleNamespace(name="test", store=None)
        results = PodResults(bucket, PACK, "pod", kept)  # type: ignore[arg-type]
        job = PACK.job(1, (RUN,))
        for files in (first, then):
            kept.objects.clear()
            for path, size in files.items():
                (folder / path).parent.mkdir(parents=True, exist_ok=True)
                text = b"line of a log\n" * (size // 14 + 1)
                (folder / path).write_bytes(text[:size])
            results._next_snapshot = 0.0
            results.store_logs(job, folder)
            assert sum(map(len, kept.objects.values())) <= ROOM + 200
            log = kept.objects.get(LOG)
            size = files.get("logs/system.log")
            if size is not None:
                assert log is not None
                assert (len(log) == size) == (size <= ROOM)
                assert size <= ROOM or log.startswith(b"... the first ")
            kept_now = dict(kept.objects)
            kept.objects.clear()
            results._next_snapshot = 0.0
            results.store_logs(job, folder)
            assert not set(kept.objects) & set(kept_now), "unchanged files were stored again"


def test_the_pace_and_the_number_of_files_are_limited(tmp_path: Path) -> None:
    folder = tmp_path / "job-0"
    (folder / "logs").mkdir(parents=True)
    for number in range(1000):
        (folder / "logs" / f"{number}.log").write_bytes(bytes(100_000))
    kept, bucket = Kept(), SimpleNamespace(name="test", store=None)
    results = PodResults(bucket, PACK, "pod", kept)  # type: ignore[arg-type]
    job, begun = PACK.job(1, (RUN,)), time.monotonic()
    results.store_logs(job, folder)
    sent = sum(map(len, kept.objects.values()))
    assert len(kept.objects) <= MOST_FILES
    assert results._next_snapshot >= begun + sent / results_module.PACE
    kept.objects.clear()
    results.store_logs(job, folder)
    assert not kept.objects
