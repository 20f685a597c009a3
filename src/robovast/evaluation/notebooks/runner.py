"""Executes notebooks, a few in parallel, and caches their results until something changes."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock

from robovast.analysis.postprocessing.content import scan, signature
from robovast.base.atomic import appearing_file
from robovast.base.errors import CannotRunError, InputError, StorageError
from robovast.base.file_errors import read_content, reading
from robovast.base.optional_deps import NOTEBOOKS
from robovast.base.safe_paths import read_end, read_file
from robovast.campaign.layout import POSTPROCESSING, RUNNING
from robovast.evaluation.confined_files import read_small
from robovast.evaluation.notebooks.workloads import Notebook, Target
from robovast.evaluation.untrusted_data import mapping, parse_json
from robovast.execution.local.process_environment import cache_folder

AT_ONCE = 2
"""Number of notebooks executed in parallel."""
TIMEOUT = 600.0
"""Time limit for all cells of a notebook [s]."""
GRACE = 60
"""Additional time for the kernel's start and for rendering [s]."""
MOST_KEPT = 200
"""Number of cached results; the oldest are removed."""

_FORMAT = 1
_LARGEST = 64 << 20
"""Largest notebook [bytes]; saved outputs may contain pictures."""
_KEY = re.compile(r"[0-9a-f]{64}")
_OWN = (POSTPROCESSING, ".cache", RUNNING)


@dataclass(frozen=True)
class NotebookResult:
    """Result of executing a notebook."""

    key: str
    fault: str
    """The error and its cell; empty if there was none."""
    seconds: float
    ended: float
    """End of the execution [s since the epoch]."""
    has_output: bool


@dataclass(frozen=True)
class Task:
    """A notebook and its data."""

    notebook: Path
    data_dir: Path
    key: str
    """Digest of notebook, folder, batch and time stamps of the data files."""
    batch: int | None = None
    """Number of a search's batch, if it is about one."""


def data_key(target: Target) -> str:
    """A digest that stays the same while no file of a target changes.

    Raises:
        InputError: its folder cannot be read.
    """
    with reading(target.folder):
        return signature(scan(target.folder, _OWN))


def make_task(notebook: Notebook, target: Target, data: str) -> Task:
    """Create a task; `data` is the target's `data_key`.

    Raises:
        InputError: there is no such notebook.
    """
    path = notebook.file()
    with reading(path):
        content = read_file(path, most=_LARGEST)
    parts = [str(_FORMAT), sys.executable, str(path), str(target.folder), data]
    parts += [] if target.batch is None else [str(target.batch)]
    digest = hashlib.sha256(content)
    digest.update("\0".join(parts).encode("utf-8", "surrogateescape"))
    return Task(path, target.folder, digest.hexdigest(), target.batch)


class Runner:
    """Executes tasks in separate processes; thread-safe."""

    def __init__(self, timeout: float = TIMEOUT, cache: Path | None = None) -> None:
        self._timeout = timeout
        self._cache = cache or cache_folder() / "notebooks"
        self._pool = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="notebook")
        self._waiting: dict[str, Future[NotebookResult]] = {}
        self._children: set[subprocess.Popen[bytes]] = set()
        self._closed = False
        self._lock = Lock()

    def is_waiting(self, key: str) -> bool:
        """Whether a task is in progress or queued."""
        return key in self._waiting

    def kept(self, key: str) -> NotebookResult | None:
        """The cached result of a task, or None."""
        try:
            content = read_small(self._cache.resolve(), f"{_checked(key)}/result.json")
        except InputError:
            return None
        data = mapping(parse_json(content))
        return NotebookResult(
            key,
            str(data.get("fault", "")),
            float(data.get("seconds", 0)),
            float(data.get("ended", 0)),
            os.path.isfile(self._cache / key / "output.html"),
        )

    def html(self, key: str) -> bytes:
        """The HTML of a cached result.

        Raises:
            InputError: there is no result.
        """
        return read_content(self._cache / _checked(key) / "output.html")

    def execute(self, task: Task, again: bool = False) -> Future[NotebookResult]:
        """Queue a task. Repeated requests share one execution unless it failed.

        Args:
            task: the task.
            again: ignore a cached result.

        Raises:
            CannotRunError: the extra is missing, or the runner was closed.
        """
        NOTEBOOKS.require("A notebook")
        with self._lock:
            waiting = self._waiting.get(task.key)
            if waiting is not None:
                return waiting
            kept = None if again else self.kept(task.key)
            if kept is not None and not kept.fault:
                return _done(kept)
            if self._closed:
                raise CannotRunError("The server is about to end.")
            future = self._pool.submit(self._execute, task)
            self._waiting[task.key] = future
        future.add_done_callback(lambda _: self._waiting.pop(task.key, None))
        return future

    def close(self) -> None:
        """Stop tasks in progress and refuse new ones. A signal handler may call it."""
        self._closed = True
        self._pool.shutdown(wait=False, cancel_futures=True)
        for child in tuple(self._children):
            child.terminate()

    def _execute(self, task: Task) -> NotebookResult:
        with TemporaryDirectory(prefix="robovast-notebook-") as name:
            folder = Path(name)
            request = {
                "notebook": str(task.notebook),
                "data_dir": str(task.data_dir),
                "batch": task.batch,
                "timeout": self._timeout,
            }
            (folder / "request.json").write_text(json.dumps(request))
            self._run_child(folder)
            self._keep(task.key, folder)
        kept = self.kept(task.key)
        if kept is None:
            raise StorageError(f"{self._cache / task.key} has gone.")
        return kept

    def _run_child(self, folder: Path) -> None:
        """Execute the request in a folder by a process.

        Raises:
            CannotRunError: the process left no result, or was stopped by `close`.
        """
        command = [sys.executable, "-m", "robovast.evaluation.notebooks.child", str(folder)]
        log = folder / "child.log"
        with (
            log.open("wb") as out,
            subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=out) as child,
        ):
            self._children.add(child)
            try:
                if self._closed:
                    child.terminate()
                child.wait(self._timeout + GRACE)
            except subprocess.TimeoutExpired:
                child.terminate()
                _wait_or_kill(child)
            finally:
                self._children.discard(child)
        if self._closed:
            raise CannotRunError(
                "The server stopped while the notebook was running.",
                hint="start the server and the notebook again",
            )
        if not os.path.isfile(folder / "result.json"):
            said = read_end(log, folder, 2000)[0].decode(errors="replace").strip()
            raise CannotRunError(f"The notebook did not finish. {said}")

    def _keep(self, key: str, folder: Path) -> None:
        """Move the result in a folder to the cache."""
        target = self._cache / key
        try:
            self._cache.mkdir(mode=0o700, parents=True, exist_ok=True)
            shutil.rmtree(target, ignore_errors=True)
            target.mkdir()
            for name in ("output.html", "result.json"):  # complete when the last is there
                if os.path.exists(folder / name):
                    with appearing_file(target / name) as part:
                        shutil.copyfile(folder / name, part)
            _remove_oldest(self._cache)
        except OSError as error:
            raise StorageError(f"{target} cannot be written: {error.strerror}.") from None


def _checked(key: str) -> str:
    if not _KEY.fullmatch(key):
        raise InputError(f"{key!r} is the key of no result.")
    return key


def _done(result: NotebookResult) -> Future[NotebookResult]:
    future: Future[NotebookResult] = Future()
    future.set_result(result)
    return future


def _wait_or_kill(child: subprocess.Popen[bytes]) -> None:
    try:
        child.wait(10)
    except subprocess.TimeoutExpired:
        child.kill()


def _remove_oldest(cache: Path) -> None:
    newest = sorted(cache.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
    for path in newest[MOST_KEPT:]:
        shutil.rmtree(path, ignore_errors=True)
