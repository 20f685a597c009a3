"""Details of one run: its record and the paths of its files."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robovast.base.errors import InputError
from robovast.base.xml_files import parse_xml
from robovast.campaign.layout import (
    EXECUTION_RECORD,
    JOB_LINK,
    JOBS,
    POSTPROCESSING,
    REPLAY,
    RUN_RECORD,
    SYSINFO,
    TEST_RESULT,
)
from robovast.evaluation.confined_files import read_small, resolved
from robovast.evaluation.drive.bag_discovery import bags_in
from robovast.evaluation.files import FileEntry, list_files
from robovast.evaluation.launch.commands import as_shell, repeat_words
from robovast.evaluation.map_picture import has_map
from robovast.evaluation.untrusted_data import LONGEST, mapping, parse_json, read_yaml

_WHOLE = re.compile(r"[0-9]{1,20}")


@dataclass(frozen=True)
class Bag:
    """A ROS bag as described by its metadata."""

    path: str
    """Path relative to the results folder."""
    start: float
    """[s since the epoch]"""
    duration: float
    """[s]"""
    topics: list[tuple[str, str, int]]
    """Name, type and number of messages of each topic."""


@dataclass(frozen=True)
class Timeline:
    """Messages over time."""

    start: float
    """[s since the epoch]"""
    end: float
    topics: dict[str, list[int]]
    """Number of messages of each topic in each of equal intervals."""


@dataclass(frozen=True, slots=True)
class Origin:
    """The origin of a file."""

    path: str
    """The file, relative to the results folder."""
    command: str
    """Postprocessing command that made it."""
    sources: list[str]
    """Files that it was made from, relative to the campaign."""


@dataclass(frozen=True)
class Replay:
    """A replay next to the run that it repeats."""

    of: str
    """The run, `<campaign>/<variant>/<run>`."""
    stored: bool
    """Whether it is in the results folder."""
    same: bool | None
    """Whether verdict and outputs are the same; None if they were not compared."""
    text: str
    """The comparison for people; empty if there is none."""


@dataclass(frozen=True)
class RunDetails:
    """All data on the page of a run."""

    record: Mapping[str, Any]
    """Content of run.json; empty if it is missing."""
    files: list[FileEntry]
    """Files in the run's folder."""
    job_files: list[FileEntry]
    """Files in its job's folder, which may be shared with other runs."""
    packed: bool = False
    """Whether its job, and thus the job's log, also contains other runs."""
    logs: list[str] = field(default_factory=list)
    """Paths of logs, the most useful first."""
    usage: list[str] = field(default_factory=list)
    """Paths of tables of resource usage."""
    sysinfo: Mapping[str, Any] = field(default_factory=dict)
    bags: list[Bag] = field(default_factory=list)
    recorded: list[str] = field(default_factory=list)
    """Folders of bags, also of recorders that were killed; the likeliest to be played first."""
    command: str = ""
    """Shell command that reproduces this run on this machine, as `vast replay`."""
    replay: Replay | None = None
    """If the run is a replay: how it compares with the run that it repeats."""
    origins: list[Origin] = field(default_factory=list)
    """Origins of files made by postprocessing."""
    on_map: bool = False
    """Whether there is a map of its configuration."""
    failure: str = ""
    """All failures in test.xml, if the run did not pass."""


def read_run(results: Path, campaign: str, variant: str, number: int) -> RunDetails:
    """One run of a campaign.

    Raises:
        InputError: there is no such run.
    """
    place = f"{campaign}/{variant}/{number}"
    files = list_files(results, place)
    record = run_record(results, place)
    job = _job_folder(results, campaign, place, record)
    job_files = list_files(results, job) if job else []
    return RunDetails(
        record=record,
        files=files,
        job_files=job_files,
        packed=_is_packed(results, job),
        logs=_logs(job_files, files),
        usage=[e.path for e in (*job_files, *files) if _is_usage(e.name)],
        sysinfo=_sysinfo(results, place, job),
        bags=list(_bags(results, files)),
        origins=list(_origins(results, campaign, place)),
        recorded=bags_in(files),
        command=as_shell(repeat_words(results, place, record)),
        on_map=has_map(results, campaign, variant),
        failure=_failure(results, place),
        replay=_replay(results, campaign),
    )


def _replay(results: Path, campaign: str) -> Replay | None:
    of = read_yaml(results, f"{campaign}/{EXECUTION_RECORD}").get("replay_of")
    if not isinstance(of, str):
        return None
    found = _json(results, f"{campaign}/{REPLAY}")
    same, lines = found.get("same"), found.get("text")
    try:
        stored = os.path.isdir(resolved(results, of))
    except InputError:
        stored = False
    text = "\n".join(map(str, lines)) if isinstance(lines, list) else ""
    return Replay(of[:LONGEST], stored, same if isinstance(same, bool) else None, text[:LONGEST])


def run_record(results: Path, place: str) -> Mapping[str, Any]:
    """Content of the run.json below `place`; empty if it is missing."""
    return _json(results, f"{place}/{RUN_RECORD}")


def _json(results: Path, path: str) -> Mapping[str, Any]:
    try:
        return mapping(parse_json(read_small(results, path)))
    except InputError:
        return {}


def _job_folder(results: Path, campaign: str, place: str, record: Mapping[str, Any]) -> str | None:
    """The job's folder relative to the results; None when there is none inside."""
    named = [f"{campaign}/{JOBS}/{record['job']}"] if record.get("job") else []
    for candidate in (*named, f"{place}/{JOB_LINK}"):
        try:
            folder = resolved(results, candidate)
        except InputError:
            continue
        if os.path.isdir(folder) and folder.is_relative_to(results / campaign):
            return folder.relative_to(results).as_posix()
    return None


def logs_of(
    results: Path, campaign: str, place: str, record: Mapping[str, Any]
) -> tuple[list[str], bool]:
    """Paths of a run's logs, the most useful first, and whether they are of other runs too.

    Raises:
        InputError: there is no such run.
    """
    job = _job_folder(results, campaign, place, record)
    job_files = list_files(results, job) if job else []
    return _logs(job_files, list_files(results, place)), _is_packed(results, job)


def _logs(job_files: list[FileEntry], files: list[FileEntry]) -> list[str]:
    return [entry.path for entry in (*job_files, *files) if entry.kind == "log"]


def _is_packed(results: Path, job: str | None) -> bool:
    return job is not None and _finished_runs(results, job) > 1


def _finished_runs(results: Path, job: str) -> int:
    try:
        return len(read_small(results, f"{job}/finished_runs").splitlines())
    except InputError:
        return 0


def _is_usage(name: str) -> bool:
    file = name.rpartition("/")[2]
    return file.startswith("resource_usage") and file.endswith(".csv")


def _sysinfo(results: Path, place: str, job: str | None) -> Mapping[str, Any]:
    for folder in filter(None, (place, job)):
        if found := read_yaml(results, f"{folder}/{SYSINFO}"):
            return found
    return {}


def _failure(results: Path, place: str) -> str:
    """Text of all failures in test.xml."""
    try:
        suite = parse_xml(read_small(results, f"{place}/{TEST_RESULT}"))
    except (InputError, ValueError):
        return ""  # the verdict's reason reports it
    found = [item for tag in ("failure", "error") for item in suite.iter(tag)]
    texts = [filter(None, (item.get("message"), item.text)) for item in found]
    return "\n\n".join("\n".join(text) for text in texts)[:LONGEST]


def _origins(results: Path, campaign: str, place: str) -> Iterator[Origin]:
    entries = read_yaml(results, f"{place}/{POSTPROCESSING}").get("entries")
    for entry in entries if isinstance(entries, list) else ():
        if isinstance(entry, dict) and "output" in entry:
            sources = entry.get("sources")
            yield Origin(
                path=f"{campaign}/{entry['output']}",
                command=str(entry.get("plugin") or ""),
                sources=list(map(str, sources)) if isinstance(sources, list) else [],
            )


def _bags(results: Path, files: list[FileEntry]) -> Iterator[Bag]:
    for entry in files:
        if not entry.path.endswith("/metadata.yaml"):
            continue
        data = read_yaml(results, entry.path).get("rosbag2_bagfile_information")
        if isinstance(data, dict):
            yield _bag(entry.path.removesuffix("/metadata.yaml"), data)


def _bag(path: str, data: Mapping[str, Any]) -> Bag:
    topics = data.get("topics_with_message_count")
    described = [
        (mapping(item.get("topic_metadata")), item.get("message_count"))
        for item in (topics if isinstance(topics, list) else ())
        if isinstance(item, dict)
    ]
    return Bag(
        path=path,
        start=_whole(mapping(data.get("starting_time")).get("nanoseconds_since_epoch")) / 1e9,
        duration=_whole(mapping(data.get("duration")).get("nanoseconds")) / 1e9,
        topics=[
            (str(topic.get("name")), str(topic.get("type")), _whole(count))
            for topic, count in described
        ],
    )


def _whole(value: Any) -> int:
    """A whole number; `plain` converts numbers that are too large for JavaScript to text."""
    return int(value) if _WHOLE.fullmatch(str(value)) else 0
