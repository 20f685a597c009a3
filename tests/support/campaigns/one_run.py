"""One run, stored by writers that are killed after any request, or whose requests alternate."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Condition, Thread
from typing import Any

from robovast_testbed.s3 import Server

from robovast.agent.bucket import Bucket
from robovast.agent.pack import Pack
from robovast.agent.results import PodResults
from robovast.campaign.records import EndedRun
from robovast.campaign.verdict import TestResult, Verdict
from robovast.model.plan import Run
from robovast.model.scenario import Scenario
from robovast.model.variant import Variant
from robovast.storage.download import Silent, download_campaign
from robovast.storage.endpoint import Credentials, Endpoint
from robovast.storage.s3 import ObjectStore
from support.campaigns.owner import OWNER
from support.patience import PATIENCE

Files = Mapping[str, bytes]


def open_store(server: Server) -> ObjectStore:
    credentials = Credentials(server.access_key, server.secret_key)
    return ObjectStore(Endpoint.parse(f"http://{server.endpoint}"), credentials, patience=20)


class Killed(BaseException):
    """The process was killed."""


@contextmanager
def around_requests(
    store: ObjectStore, around: Callable[[Callable[[], Any]], Any]
) -> Iterator[None]:
    """Let every request of a store pass through `around`."""
    http = store._client._http  # what all of its requests go through
    send = http.urlopen

    def urlopen(*given: Any, **named: Any) -> Any:
        return around(lambda: send(*given, **named))

    http.urlopen = urlopen  # type: ignore[method-assign]
    try:
        yield
    finally:
        http.urlopen = send  # type: ignore[method-assign]


def killed_after(store: ObjectStore, number: int, action: Callable[[], object]) -> bool:
    """Do something and be killed after so many requests; False when it needed fewer."""
    sent = itertools.count()

    def around(send: Callable[[], Any]) -> Any:
        if next(sent) >= number:
            raise Killed
        return send()

    with around_requests(store, around):
        try:
            action()
        except Killed:
            return True
    return False


@dataclass
class Execution:
    """A run that a pod has executed, and that is not stored yet."""

    server: Server
    bucket: str
    run: str
    """`<variant>/<number>`."""
    name: str
    """Is in everything that the run wrote."""
    attempt: int = 1
    files: Files = field(default_factory=dict)
    store: ObjectStore = field(init=False)

    def __post_init__(self) -> None:
        self.store = open_store(self.server)
        own = {"out.csv": f"{self.name} wrote this".encode()}
        self.files = {**own, **self.files}
        variant, number = self.run.split("/")
        self._run = Run(0, Variant(variant, "entry", {}), int(number))
        self._results = PodResults(Bucket(self.store, self.bucket, OWNER), self._pack(), pod="")

    def _pack(self) -> Pack:
        return Pack(
            campaign="test",
            bucket=self.bucket,
            owner=OWNER,
            image="",
            number=0,
            attempt=self.attempt,
            runs=(self._run,),
            done={},
            first_job=1,
            scenario=Scenario("test", ()),
            timeout=None,
            secondaries=(),
            environment={},
        )

    def claim(self) -> None:
        """Have a name for the job already."""
        self._results._name(self._pack().job(1, (self._run,)))

    def storing(self) -> Verdict:
        """Store it."""
        with TemporaryDirectory() as folder:
            out = Path(folder, "run")
            for path, content in self.files.items():
                (out / path).parent.mkdir(parents=True, exist_ok=True)
                (out / path).write_bytes(content)
            job = self._pack().job(1, (self._run,))
            result = TestResult(Verdict.FAILED, self.name)
            ended = EndedRun(job, self._run, out, result, (1e9, 1e9 + 1), None)
            return self._results.store_run(ended).verdict


def downloaded(store: ObjectStore, bucket: str, run: str) -> tuple[dict[str, Any], Files] | None:
    """Record and files of a run as a reader gets them; None when it is not there."""
    with TemporaryDirectory() as home:
        download_campaign(store, bucket, Path(home), Silent())
        folder = Path(home, run)
        if not folder.exists():
            return None
        files = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in folder.rglob("*")
            if path.is_file() and not path.is_symlink()
        }
        return json.loads(files.pop("run.json")), files


def check_whole(
    store: ObjectStore, bucket: str, run: str, executions: Iterable[Execution]
) -> Execution | None:
    """Which execution a reader sees: all of it and nothing else; None when it sees nothing."""
    found = downloaded(store, bucket, run)
    if found is None:
        return None
    record, files = found
    by_name = {execution.name: execution for execution in executions}
    seen = by_name[record["reason"]]
    assert files == seen.files
    assert record["attempt"] == seen.attempt
    return seen


class Stepper:
    """Lets writers send one request at a time, in an order that is given."""

    def __init__(self, executions: Iterable[Execution]) -> None:
        self._changed = Condition()
        self._waiting: dict[str, int] = {}
        self._granted: str | None = None
        self._done: dict[str, object] = {}
        self._threads = [Thread(target=self._write, args=(e,), daemon=True) for e in executions]

    def start(self) -> None:
        for thread in self._threads:
            thread.start()

    def step(self, name: str) -> bool:
        """Let a writer send its next request; False when it has ended."""
        with self._changed:
            assert self._changed.wait_for(
                lambda: self._waiting.get(name, 0) or name in self._done, PATIENCE
            )
            if name in self._done:
                return False
            self._granted = name
            self._changed.notify_all()
            assert self._changed.wait_for(lambda: self._granted is None, PATIENCE)
            return True

    def finish(self, names: Iterable[str]) -> dict[str, object]:
        """Let them send what is left, in turn; returns verdicts, or what went wrong."""
        left = list(names)
        while left:
            left = [name for name in left if self.step(name)]
        for thread in self._threads:
            thread.join(PATIENCE)
        return self._done

    def _write(self, execution: Execution) -> None:
        ended: object
        try:
            with around_requests(execution.store, lambda send: self._in_turn(execution.name, send)):
                ended = execution.storing()
        except BaseException as error:  # told to the test
            ended = error
        with self._changed:
            self._done[execution.name] = ended
            self._changed.notify_all()

    def _in_turn(self, name: str, send: Callable[[], Any]) -> Any:
        with self._changed:
            self._waiting[name] = self._waiting.get(name, 0) + 1
            self._changed.notify_all()
            assert self._changed.wait_for(lambda: self._granted == name, PATIENCE)
            self._waiting[name] -= 1
            self._granted = f"{name} sends"
        try:
            return send()
        finally:
            with self._changed:
                self._granted = None
                self._changed.notify_all()
