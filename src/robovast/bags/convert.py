"""All that is wanted from the bags of a run, in one pass over each bag."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from rosbags.serde import SerdeError

from robovast.bags.definitions import DefinitionError
from robovast.bags.files import read_bag, read_info
from robovast.bags.job import Context, Job, Worker
from robovast.bags.rosout import ROSOUT, RosoutToCsv
from robovast.bags.source import Consumer, Topic
from robovast.errors import StorageError
from robovast.results.layout import JOB_LINK, job_folder
from robovast.results.run_record import read_run_record
from robovast.safe_paths import is_folder
from rosbags_common import find_rosbags

BAG = "rosbag2"
"""What the folder of a bag is called."""
JOB_LOGS = Path("logs/rosout_bag")
"""Where the entrypoint records what all runs of a job logged, in the job's folder."""

_UNDECODABLE = (
    struct.error,
    SerdeError,
    ValueError,
    IndexError,
    KeyError,
    OverflowError,
    MemoryError,
)


@dataclass(frozen=True)
class Output:
    """A file that a job made."""

    path: Path
    bag: Path
    """What it was made from."""
    job: Job


@dataclass
class Conversion:
    """What came out of some bags."""

    outputs: list[Output] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    """What is missing or could not be read."""

    def add(self, other: Conversion) -> None:
        """Append what came out of another bag."""
        self.outputs += other.outputs
        self.warnings += other.warnings

    def provenance(self, results_dir: Path) -> list[dict[str, Any]]:
        """An entry `{output, sources, plugin, params}` per file, its paths relative to a folder."""
        return [
            {
                "output": str(output.path.relative_to(results_dir)),
                "sources": [str(output.bag.relative_to(results_dir))],
                "plugin": output.job.command,
                "params": output.job.model_dump(mode="json", exclude_defaults=True),
            }
            for output in self.outputs
        ]


def convert_bag(
    bag_dir: Path,
    run_dir: Path,
    jobs: Sequence[Job],
    *,
    definitions: Path | None = None,
    window: tuple[int, int] | None = None,
) -> Conversion:
    """Do every job in one pass over a bag.

    Files take their names when they are complete; of an interrupted conversion none remain.

    Args:
        bag_dir: the bag.
        run_dir: where files are written.
        jobs: what is wanted.
        definitions: folder searched for message definitions that the bag lacks.
        window: from when to when the run took place [ns], for bags of several runs.

    Raises:
        StorageError: a file cannot be written.
    """
    found: dict[str, None] = {}
    workers: list[Worker] = []
    try:
        info = read_info(bag_dir, found.setdefault)
        context = Context(
            bag=bag_dir,
            folder=run_dir,
            warn=found.setdefault,
            definitions=definitions,
            distribution=info.distribution,
            topics=dict(info.topics),
            window=window,
        )
        feeds = _Feeds(context, workers)
        for number, job in enumerate(jobs):
            workers.append(job.start(replace(context, number=number)))
        read_bag(bag_dir, info, feeds.subscribe, context.warn)
        feeds.report()
        outputs = [
            Output(path, bag_dir, job)
            for job, worker in zip(jobs, workers, strict=True)
            for path in worker.finish()
        ]
    except BaseException as error:
        for worker in workers:
            with suppress(OSError):
                worker.discard()
        if isinstance(error, OSError):
            raise StorageError(f"the bag {bag_dir} cannot be converted: {error}") from error
        raise
    return Conversion(outputs, list(found))


def convert_run(run_dir: Path, jobs: Sequence[Job], definitions: Path | None = None) -> Conversion:
    """Do every job in one pass over each bag of a run.

    A bag is a folder `rosbag2` at any depth. Log messages are taken from the recording of the
    run's job where the run has none itself.

    Args:
        run_dir: the run's folder.
        jobs: what is wanted; files are written beside each bag, of the job's recording into the
            run's folder.
        definitions: folder searched for message definitions that a bag lacks.

    Raises:
        StorageError: a file cannot be written.
    """
    bags = [Path(path) for path in find_rosbags(run_dir)]
    logs = _job_logs(run_dir)
    apart = [job for job in jobs if isinstance(job, RosoutToCsv)] if logs else []
    if any(_has_rosout(bag) for bag in bags):
        apart = []
    of_bags = [job for job in jobs if job not in apart]
    conversion = Conversion()
    if logs and apart:
        window = _window(run_dir)
        conversion.add(convert_bag(logs, run_dir, apart, definitions=definitions, window=window))
    if of_bags and not bags:
        conversion.warnings.append(f"there is no bag: no folder `{BAG}` in it")
    for bag in bags if of_bags else []:
        conversion.add(convert_bag(bag, bag.parent, of_bags, definitions=definitions))
    return conversion


def _job_logs(run_dir: Path) -> Path | None:
    """The recording of a run's job, by way of the run's link to it."""
    job = job_folder(run_dir)
    there = job is not None and is_folder(job / JOB_LOGS, job)
    return run_dir / JOB_LINK / JOB_LOGS if there else None


def _has_rosout(bag: Path) -> bool:
    ignored: list[str] = []
    return ROSOUT in read_info(bag, ignored.append).topics


def _window(run_dir: Path) -> tuple[int, int] | None:
    """From when to when a run took place [ns], as its record says."""
    record = read_run_record(run_dir)
    try:
        return (_moment(record.started_at), _moment(record.finished_at)) if record else None
    except ValueError:
        return None


def _moment(text: str) -> int:
    return int(datetime.fromisoformat(text).timestamp() * 1_000_000_000)


class _Feeds:
    """Connects topics with the workers that want them."""

    def __init__(self, context: Context, workers: list[Worker]) -> None:
        self._context = context
        self._workers = workers
        self._feeds: dict[Topic, _Feed] = {}

    def subscribe(self, topic: Topic) -> Consumer | None:
        if topic not in self._feeds:
            self._context.topics.setdefault(topic.name, topic.type)
            self._feeds[topic] = _Feed(topic, list(self._consumers(topic)))
        return self._feeds[topic].consumer()

    def _consumers(self, topic: Topic) -> Iterable[Consumer]:
        for worker in self._workers:
            try:
                consumer = worker.subscribe(topic)
            except DefinitionError as error:
                self._context.warn(f"{topic.name} is left out: {error}")
                continue
            if consumer and topic.serialization == "cdr":
                yield consumer
            elif consumer:
                self._context.warn(
                    f"{topic.name} is left out: its messages are {topic.serialization}, not cdr"
                )

    def report(self) -> None:
        """Say how many messages could not be decoded."""
        for feed in self._feeds.values():
            if feed.damaged:
                self._context.warn(
                    f"{feed.damaged} messages on {feed.topic.name} are left out: they are no "
                    f"{feed.topic.type} ({feed.reason})"
                )


class _Feed:
    """Hands the messages of a topic out, and counts those that cannot be decoded."""

    def __init__(self, topic: Topic, consumers: list[Consumer]) -> None:
        self.topic = topic
        self.damaged = 0
        self.reason = ""
        self._consumers = consumers

    def consumer(self) -> Consumer | None:
        return self._take if self._consumers else None

    def _take(self, time: int, data: bytes) -> None:
        reason = ""
        for consume in self._consumers:
            try:
                consume(time, data)
            except _UNDECODABLE as error:
                reason = str(error) or type(error).__name__
        if reason:
            self.damaged += 1
            self.reason = self.reason or reason
