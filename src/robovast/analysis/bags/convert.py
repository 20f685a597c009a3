"""Executes all jobs for the bags of a run in one pass over each bag."""

from __future__ import annotations

import os
import struct
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from rosbags.serde import SerdeError

from robovast.analysis.bags.definitions import DefinitionError
from robovast.analysis.bags.files import read_bag, read_info
from robovast.analysis.bags.job import Context, JobWorker
from robovast.analysis.bags.jobs import start
from robovast.analysis.bags.names import ends_with, undated
from robovast.analysis.bags.rosout import ROSOUT
from robovast.analysis.bags.source import Consumer, Topic
from robovast.base.errors import RobovastError, StorageError
from robovast.base.safe_paths import is_folder
from robovast.campaign.layout import JOB_LINK, job_folder
from robovast.campaign.run_record import read_run_record
from robovast.model.document.commands import JOB_LOGS, BagCommand, RosoutToCsv
from rosbags_common import find_rosbags

BAG = "rosbag2"
"""Default name of a bag's folder."""

_UNDECODABLE = (
    struct.error,
    SerdeError,
    ValueError,
    IndexError,
    KeyError,
    AttributeError,  # the bag defines a known type without one of its fields
    OverflowError,
    MemoryError,
)


@dataclass(frozen=True)
class ConvertedFile:
    """A file that a job made."""

    path: Path
    bag: Path
    """The files that it was made from."""
    job: BagCommand


@dataclass
class Conversion:
    """The result of converting bags."""

    outputs: list[ConvertedFile] = field(default_factory=list)
    remarks: dict[tuple[BagCommand | None, str], None] = field(default_factory=dict)
    """Missing or unreadable data; each remark with the job it concerns, or None."""
    failures: dict[BagCommand, str] = field(default_factory=dict)
    """Reasons of failed jobs."""

    @property
    def warnings(self) -> list[str]:
        """All remarks and failures, without duplicates."""
        return list(dict.fromkeys([*(text for _, text in self.remarks), *self.failures.values()]))

    def provenance(self, results_dir: Path) -> list[dict[str, Any]]:
        """Entries `{output, sources, plugin, params}` with paths relative to a folder."""
        return [
            {
                "output": str(output.path.relative_to(results_dir)),
                "sources": [str(output.bag.relative_to(results_dir))],
                "plugin": output.job.command,
                "params": output.job.model_dump(mode="json", exclude_defaults=True),
            }
            for output in self.outputs
        ]


@dataclass(frozen=True)
class _Task:
    """A job on one bag."""

    job: BagCommand
    folder: Path
    """Output folder."""
    window: tuple[int, int] | None = None
    """Start and end of the run [ns], for bags of several runs."""
    shared: bool = False
    """The bag contains all runs of a job, so its files do not belong to a single run."""
    source: Path | None = None
    """Recorded as source of the files in place of the bag's own path."""


def convert_run(
    run_dir: Path, jobs: Sequence[BagCommand], definitions: Path | None = None
) -> Conversion:
    """Execute all jobs in one pass over each bag of a run.

    Files are written beside each bag. If the run's own bag has no log messages, they are taken from
    the recording of the run's job, cut to the run; the table of the whole recording is beside it.

    Args:
        run_dir: the run's folder.
        jobs: the jobs; each sets the path suffix of its bag, which is searched at any depth of the
            run's and its job's folder.
        definitions: folder that is searched for message definitions missing from a bag.

    Raises:
        StorageError: a file cannot be written.
    """
    conversion = Conversion()
    tasks: dict[Path, list[_Task]] = {}
    warn = conversion.remarks.setdefault
    for job in jobs:
        found = list(_tasks(run_dir, job, lambda text: warn((None, text))))
        for bag, task in found:
            tasks.setdefault(bag, []).append(task)
        if not found:
            conversion.remarks[_missing(run_dir, job)] = None
    for bag, of_bag in tasks.items():
        with _unmoved([task.folder for task in of_bag if task.shared]):
            _convert(bag, of_bag, definitions, conversion)
    return conversion


def _tasks(
    run_dir: Path, job: BagCommand, warn: Callable[[str], object]
) -> Iterator[tuple[Path, _Task]]:
    """The tasks of a job: one for each of its bags."""
    own = _bags(run_dir, job.bag_dir, warn)
    recording = _recording(run_dir, job.bag_dir)
    if isinstance(job, RosoutToCsv):
        if job.bag_dir == JOB_LOGS:
            own += [bag for bag in _bags(run_dir, BAG) if _may_have_rosout(bag, recording)]
        if recording and not own:
            shown = run_dir / JOB_LINK / job.bag_dir
            yield recording, _Task(job, run_dir, _window(run_dir), source=shown)
    yield from ((bag, _Task(job, bag.parent)) for bag in own)
    if recording:
        yield recording, _Task(job, recording.parent, shared=True)


def _missing(run_dir: Path, job: BagCommand) -> tuple[BagCommand | None, str]:
    """The remark that a job's bag is missing."""
    name = BAG if job.bag_dir == JOB_LOGS else job.bag_dir
    if _bags(run_dir, name):
        return job, f"neither its bag nor its job's recording has {ROSOUT}"
    return None, f"there is no bag: no folder `{name}` in it"


def _bags(run_dir: Path, bag_dir: str, ignored: Callable[[str], object] = len) -> list[Path]:
    """Bags of a run whose path ends with names or patterns, one of each folder.

    Several in a folder would be converted to the same files. The one without a date counts, or else
    the one recorded last.

    Args:
        run_dir: the run's folder.
        bag_dir: the names or patterns.
        ignored: receives a remark on each folder with several bags.
    """
    found: dict[Path, list[Path]] = {}
    for bag in map(Path, find_rosbags(run_dir, Path(bag_dir).name)):
        if ends_with(bag.relative_to(run_dir), bag_dir):
            found.setdefault(bag.parent, []).append(bag)
    for bags in found.values():
        bags.sort(key=lambda bag: (bag.name == undated(bag.name), bag.name))
        if len(bags) > 1:
            others = ", ".join(bag.name for bag in bags[:-1])
            ignored(f"only the bag {bags[-1].name} is converted, not {others}; see `bag_dir`")
    return [bags[-1] for bags in found.values()]


def _recording(run_dir: Path, bag_dir: str) -> Path | None:
    """The recording of a run's job; always in the run's own campaign, whatever the link says."""
    job = job_folder(run_dir) if bag_dir.startswith("logs/") else None
    return job / bag_dir if job is not None and is_folder(job / bag_dir, job) else None


@contextmanager
def _unmoved(folders: Iterable[Path]) -> Iterator[None]:
    """Preserve modification times of folders, so that new tables do not count as changes."""
    times = {folder: folder.stat().st_mtime_ns for folder in folders}
    try:
        yield
    finally:
        for folder, time in times.items():
            os.utime(folder, ns=(time, time))


def _convert(
    bag: Path, tasks: Sequence[_Task], definitions: Path | None, conversion: Conversion
) -> None:
    """Execute tasks in one pass over a bag and add their results."""
    works: list[_Work] = []
    warn = conversion.remarks.setdefault
    try:
        info = read_info(bag, lambda text: warn((None, text)))
        context = Context(
            bag=bag,
            folder=bag.parent,
            warn=lambda text: warn((None, text)),
            definitions=definitions,
            distribution=info.distribution,
            topics=dict(info.topics),
        )
        for task in tasks:
            works.append(_Work(task, context, conversion))
        feeds = _Feeds(context, works)
        read_bag(bag, info, feeds.subscribe, context.warn)
        feeds.report()
        for work in works:
            conversion.outputs += work.finish(bag)
    except BaseException as error:
        for work in works:
            with suppress(OSError):
                work.discard()
        if isinstance(error, OSError):
            raise StorageError(f"the bag {bag} cannot be converted: {error}") from error
        raise


class _Work:
    """A task in progress; its failure does not affect others."""

    def __init__(self, task: _Task, context: Context, conversion: Conversion) -> None:
        self._task = task
        self._failures = conversion.failures
        self.context = replace(
            context,
            folder=task.folder,
            window=task.window,
            warn=lambda text: conversion.remarks.setdefault((task.job, text)),
        )
        self._worker: JobWorker | None = None
        try:
            self._worker = start(task.job, self.context)
        except RobovastError as error:
            self._failures[task.job] = str(error)

    def subscribe(self, topic: Topic) -> Consumer | None:
        """The consumer of a topic's messages, or None."""
        try:
            consumer = self._worker.subscribe(topic) if self._worker else None
        except DefinitionError as error:
            self.context.warn(f"{topic.name} is skipped: {error}")
            return None
        if consumer and topic.serialization != "cdr":
            self.context.warn(
                f"{topic.name} is skipped: its messages are {topic.serialization}, not cdr"
            )
            return None
        return self._watched(consumer) if consumer else None

    def _watched(self, consumer: Consumer) -> Consumer:
        def consume(time: int, data: bytes) -> None:
            if self._worker is None:
                return
            try:
                consumer(time, data)
            except (OSError, *_UNDECODABLE):
                raise
            except Exception as error:
                self._fail(error)

        return consume

    def finish(self, bag: Path) -> list[ConvertedFile]:
        """Complete the files and return them."""
        try:
            paths = self._worker.finish() if self._worker else []
        except OSError:
            raise
        except Exception as error:
            self._fail(error)
            return []
        source = self._task.source or bag
        return (
            [] if self._task.shared else [ConvertedFile(p, source, self._task.job) for p in paths]
        )

    def discard(self) -> None:
        """Remove unfinished files."""
        if self._worker is not None:
            self._worker.discard()

    def _fail(self, error: Exception) -> None:
        cause = str(error)
        if not isinstance(error, RobovastError):
            traceback.print_exc()
            cause = f"raised {type(error).__name__}: {error}"
        self._failures[self._task.job] = cause
        self.discard()
        self._worker = None


def _may_have_rosout(bag: Path, recording: Path | None) -> bool:
    """Whether a bag may have log messages.

    A bag with unknown topics is read only if the job has no other recording.
    """
    ignored: list[str] = []
    topics = read_info(bag, ignored.append).topics
    return ROSOUT in topics or not (topics or recording)


def _window(run_dir: Path) -> tuple[int, int] | None:
    """Start and end of a run [ns], from its record."""
    record = read_run_record(run_dir)
    try:
        return (_moment(record.started_at), _moment(record.finished_at)) if record else None
    except (ValueError, OverflowError):
        return None


def _moment(text: str) -> int:
    return int(datetime.fromisoformat(text).timestamp() * 1_000_000_000)


class _Feeds:
    """Connects topics with their consumers."""

    def __init__(self, context: Context, works: Sequence[_Work]) -> None:
        self._context = context
        self._works = works
        self._feeds: dict[Topic, _Feed] = {}

    def subscribe(self, topic: Topic) -> Consumer | None:
        if topic not in self._feeds:
            self._context.topics.setdefault(topic.name, topic.type)
            consumers = [(work, work.subscribe(topic)) for work in self._works]
            self._feeds[topic] = _Feed(topic, [(work, c) for work, c in consumers if c])
        return self._feeds[topic].consumer()

    def report(self) -> None:
        """Warn of messages that could not be decoded."""
        for feed in self._feeds.values():
            feed.report()


class _Feed:
    """Passes a topic's messages to its consumers and counts messages that cannot be decoded."""

    def __init__(self, topic: Topic, consumers: list[tuple[_Work, Consumer]]) -> None:
        self._topic = topic
        self._damaged = 0
        self._reason = ""
        self._works = [work for work, _ in consumers]
        self._consumers = [consumer for _, consumer in consumers]

    def consumer(self) -> Consumer | None:
        return self._take if self._consumers else None

    def report(self) -> None:
        """Warn through the first consumer's context."""
        if self._damaged:
            self._works[0].context.warn(
                f"{self._damaged} messages on {self._topic.name} are skipped: they are not valid "
                f"{self._topic.type} messages ({self._reason})"
            )

    def _take(self, time: int, data: bytes) -> None:
        reason = ""
        for consume in self._consumers:
            try:
                consume(time, data)
            except _UNDECODABLE as error:
                reason = str(error) or type(error).__name__
        if reason:
            self._damaged += 1
            self._reason = self._reason or reason
